"""How much of memory, processes and files a worker may have: the limits of a process, where the system has them."""

from __future__ import annotations

import contextlib
import mmap
import os
import sys

__all__ = ["limit", "private_bytes", "tasks_of"]

MIB = 1 << 20
RESERVED = 4096 * MIB  # of address space beyond the memory: threads' stacks and arenas reserve more than they use
UNKNOWN_DATA, UNKNOWN_SPACE = 64 * MIB, 512 * MIB


def private_bytes() -> tuple[int, int]:
    """What this process has of private memory and of address space; a guess where there is no /proc."""
    try:
        with open("/proc/self/statm", encoding="utf-8") as line:
            pages = [int(word) for word in line.read().split()]
    except OSError:
        return UNKNOWN_DATA, UNKNOWN_SPACE
    return pages[5] * mmap.PAGESIZE, pages[0] * mmap.PAGESIZE


def tasks_of(uid: int) -> int:
    """Threads that a user has on this machine: the kernel counts them all against each one's limit."""
    count = 0
    for name in os.listdir("/proc"):
        if name.isdigit():
            with contextlib.suppress(OSError):
                if os.stat(f"/proc/{name}").st_uid == uid:
                    count += len(os.listdir(f"/proc/{name}/task"))
    return count


def limit(*, memory_mb: int, processes: int, open_files: int, file_bytes: int, had: tuple[int, int]) -> None:
    """Bound this process and its children, each of them.

    `memory_mb` comes on top of what the interpreter `had`, as `private_bytes` told. It bounds private memory
    (RLIMIT_DATA), so that what is only reserved does not count; address space is bounded with much room above.
    """
    if sys.platform == "win32":
        raise NotImplementedError
    import resource

    data, space = had
    memory = memory_mb * MIB
    _bound(resource, "RLIMIT_DATA", data + memory)
    _bound(resource, "RLIMIT_AS", space + memory + RESERVED)
    _bound(resource, "RLIMIT_NPROC", processes)
    _bound(resource, "RLIMIT_NOFILE", open_files)
    _bound(resource, "RLIMIT_FSIZE", file_bytes)
    _bound(resource, "RLIMIT_CORE", 0)
    _bound(resource, "RLIMIT_MEMLOCK", 0)
    _bound(resource, "RLIMIT_MSGQUEUE", 0)


def _bound(resource: object, name: str, value: int) -> None:
    which = getattr(resource, name, None)
    if which is None:
        return
    _, hard = resource.getrlimit(which)  # type: ignore[attr-defined]
    if hard != resource.RLIM_INFINITY:  # type: ignore[attr-defined]
        value = min(value, hard)
    with contextlib.suppress(ValueError, OSError):  # macOS takes not every one of them
        resource.setrlimit(which, (value, value))  # type: ignore[attr-defined]
