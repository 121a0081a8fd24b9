"""A running worker process as the engine sees it: its sockets, its output, its end."""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

__all__ = ["Usage", "WorkerProcess"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """What a worker and its children hold: private and shared memory (no files' pages), and bytes in its folder."""

    memory_bytes: int
    disk_bytes: int


@dataclass(slots=True, kw_only=True)
class WorkerProcess:
    """A running worker. Its Runtime API is to be served on `listener`; identity is that socket.

    `output` (stdout and stderr) and `logs` (framed telemetry; None where descriptors are not inherited) are pipes'
    reading ends, non-blocking on POSIX. `egress` is for the worker's proxy, where its program has one. Who takes one of
    them over sets it to None here.
    """

    pid: int
    listener: socket.socket | None
    output: int | None
    logs: int | None
    tmp_dir: Path
    root_pid: int  # the worker's memory is that of this one's descendants
    ended: asyncio.Future[int]
    _kill: Callable[[], None]
    egress: socket.socket | None = None
    _closed: bool = field(default=False)

    def kill(self) -> None:
        """End it and all its processes at once; `wait` tells when that is so. Again, or later, it does nothing."""
        if not self.ended.done():
            self._kill()

    async def wait(self) -> int:
        """Its exit status, as `subprocess.Popen.returncode` has it: -9 for one that was killed."""
        return await asyncio.shield(self.ended)

    def close(self) -> None:
        """Kill it, and close what was not taken over. It is gone when `wait` says so."""
        if self._closed:
            return
        self.kill()
        self._closed = True
        for listener in (self.listener, self.egress):
            if listener is not None:
                listener.close()
        for opened in (self.output, self.logs):
            if opened is not None:
                os.close(opened)

    def usage(self) -> Usage:
        """What it holds now. Reads /proc and its folder: not for the event loop. A file or process that goes while
        it looks counts nothing."""
        memory = sum(_memory_bytes(pid) for pid in _descendants(self.root_pid))
        return Usage(memory_bytes=memory, disk_bytes=_disk_bytes(self.tmp_dir))


def _descendants(root: int) -> list[int]:
    found: list[int] = []
    waiting = [root]
    while waiting:
        pid = waiting.pop()
        with contextlib.suppress(OSError):
            for task in os.listdir(f"/proc/{pid}/task"):
                children = Path(f"/proc/{pid}/task/{task}/children").read_text().split()
                waiting += [int(child) for child in children]
                found += [int(child) for child in children]
    return found


def _memory_bytes(pid: int) -> int:
    with contextlib.suppress(OSError):
        rows = Path(f"/proc/{pid}/status").read_text().splitlines()
        return 1024 * sum(int(row.split()[1]) for row in rows if row.startswith(("RssAnon:", "RssShmem:")))
    return 0


def _disk_bytes(folder: Path) -> int:
    total = 0
    for where, _, names in os.walk(folder):
        for name in names:
            with contextlib.suppress(OSError):
                total += os.lstat(os.path.join(where, name)).st_size
    return total
