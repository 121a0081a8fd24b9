"""Shared memory: large payloads pass between the processes of a host without going through the network stack.

Opt-in, by `Context(shared_memory="auto")` or `METAROS_SHARED_MEMORY=auto`, and on Linux only. A publisher writes a
large payload into its session's pool and Zenoh sends a reference; peers on other hosts, of other users, and those
without shared memory, get the bytes as ever. Where the pool has no room, or cannot be had, the payload takes the
network: counted.

A receiver locks each publisher's pool in memory. One that may not lock any more would lose what comes through it, and
Zenoh tells neither end; so a process whose locked memory has a limit does without shared memory.
"""

from __future__ import annotations

import ctypes
import logging
import sys
import threading
from collections.abc import Mapping
from contextlib import suppress
from typing import Final

import zenoh
import zenoh.shm

from metaros.errors import ConfigError
from metaros.limits import LIMITS

__all__ = ["SharedPool", "intact", "locks_without_limit", "shared_pool"]

_log = logging.getLogger("metaros.wire")
_ENV: Final = "METAROS_SHARED_MEMORY"
_MODES: Final = ("off", "auto")
_FILES: Final = "/dev/shm"
_MAP_NORESERVE: Final = 0x4000  # of Linux; Python's mmap has no name for it before 3.13
_MLOCK_ONFAULT: Final = 1


def shared_pool(mode: str | None, environ: Mapping[str, str]) -> SharedPool | None:
    """The pool that the program or the environment asks for; None for `off` and where it does not work."""
    chosen, source = (environ.get(_ENV) or "off", _ENV) if mode is None else (mode, "shared_memory")
    if chosen not in _MODES:
        raise ConfigError(f"{source}: {chosen!r} is none of {', '.join(_MODES)}")
    if chosen != "auto" or sys.platform != "linux":
        return None
    if not locks_without_limit():
        _log.warning(
            "no shared memory, large payloads take the network: this process may lock little memory: ulimit -l"
        )
        return None
    return SharedPool()


def locks_without_limit() -> bool:
    """Whether the process may lock as much memory as it likes: `ulimit -l` says so, or it has CAP_IPC_LOCK. Linux.

    The capability that counts is the host's, not that of a user namespace, so this tries: one page over the limit.
    """
    if sys.platform != "linux":
        return False
    import mmap
    import resource

    limit_bytes = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    if limit_bytes == resource.RLIM_INFINITY:
        return True
    try:
        size_bytes = limit_bytes + mmap.PAGESIZE
        with mmap.mmap(-1, size_bytes, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | _MAP_NORESERVE) as area:
            view = ctypes.c_char.from_buffer(area)
            address = ctypes.c_void_p(ctypes.addressof(view))
            del view  # or the area could not be closed
            # nothing is touched, so it costs no memory, however large the limit is
            return bool(ctypes.CDLL(None).mlock2(address, ctypes.c_size_t(size_bytes), _MLOCK_ONFAULT) == 0)
    except (OSError, ValueError, OverflowError, AttributeError):  # no such address space; a C library without mlock2
        return False


def intact(payload: zenoh.ZBytes) -> bool:
    """Whether bytes that were copied from the payload just now are what was sent; ask after copying, for large ones.

    A publisher takes shared memory back from a process that did not run for a while, as one that a debugger stopped.
    """
    shared = payload.as_shm()
    return shared is None or shared.is_valid()


class SharedPool:
    """One session's shared memory. Thread-safe; it takes its memory when the first large payload comes.

    `placed` counts payloads that went through it, `refused` those that took the network for want of room.
    """

    def __init__(
        self,
        *,
        size_bytes: int = LIMITS.shared_memory_bytes,
        threshold_bytes: int = LIMITS.shared_memory_threshold_bytes,
    ) -> None:
        self.size_bytes = size_bytes
        self.threshold_bytes = threshold_bytes
        self.placed = 0
        self.refused = 0
        self._lock = threading.Lock()
        self._provider: zenoh.shm.ShmProvider | None = None
        self._closed = False
        self._policies = (
            zenoh.shm.GarbageCollect(),  # without it nothing that peers gave back is used again
            # What a process held that was killed is given back by nobody: Zenoh sees within 0.1 s that it gives no sign
            # of life. One that was only stopped notices afterwards that its samples are not valid any more.
            zenoh.shm.Defragment(zenoh.shm.GarbageCollect(safe=False), zenoh.shm.GarbageCollect(safe=False)),
        )

    def place(self, data: bytes) -> bytes | zenoh.shm.ZShmMut:
        """The payload in shared memory, or as it is where there is no room."""
        with self._lock:  # of large payloads only: it costs nothing beside the copy
            buffer = self._room(len(data))
            if buffer is None:
                self.refused += 1
                return data
            self.placed += 1
        buffer[:] = data
        return buffer

    def _room(self, size_bytes: int) -> zenoh.shm.ZShmMut | None:
        if self._closed:
            return None
        try:
            if self._provider is None:
                self._provider = self._open()
            for policy in self._policies:
                with suppress(zenoh.ZError):  # full, or no piece of it is long enough
                    return self._provider.alloc(size_bytes, policy)
        except MemoryError as error:
            _log.warning("no shared memory, large payloads take the network: %s", error)
            self._closed = True
        return None

    def _open(self) -> zenoh.shm.ShmProvider:
        """Writing to a page that the file system has no room for ends a process, so ask beforehand."""
        import shutil  # with what packs archives: few programs have such a pool

        free_bytes = shutil.disk_usage(_FILES).free
        if free_bytes < 2 * self.size_bytes:
            raise MemoryError(f"{_FILES} has {free_bytes} bytes left, a pool takes {self.size_bytes}")
        try:
            return zenoh.shm.ShmProvider.default_backend(self.size_bytes)
        except zenoh.ZError as error:  # such as more locked memory than the system lets a process have
            raise MemoryError(str(error)) from None

    def close(self) -> None:
        """Give the memory back; what peers still read goes with their last reference."""
        with self._lock:
            self._closed = True
            self._provider = None
