"""Reads what workers write to their pipes, at a bounded rate: who writes more waits."""

from __future__ import annotations

import asyncio
import os
import select
import sys
import threading
from collections.abc import Callable, Iterable, Mapping
from typing import Any

__all__ = ["LogPump", "ThreadPump", "pump"]

_READ_BYTES = 65_536
_PAUSE_S = 0.05
_DRAINED = 4  # reads at most of what was written before now: a pipe holds one, and who goes on writing fills it again

Take = Callable[[bytes], None]


class LogPump:
    """Reads pipes on the event loop, each into its `take`, until they end or `close`."""

    def __init__(self, loop: asyncio.AbstractEventLoop, pipes: Mapping[int, Take], *, bytes_per_s: int) -> None:
        self._loop, self._pipes = loop, dict(pipes)
        self._per_s = bytes_per_s
        self._left_bytes = float(bytes_per_s)
        self._filled_s = loop.time()
        self._paused: asyncio.TimerHandle | None = None
        self._poll = _poll(self._pipes)
        self._listen()

    def drain(self) -> None:
        """Read now what was written before now, as far as the rate allows."""
        for _ in range(_DRAINED):
            ready = self._poll.poll(0) if self._left_bytes > 0 else ()
            if not ready:
                return
            for fd, _ in ready:
                self._read(fd)

    def close(self) -> None:
        """Read no more; the descriptors stay open."""
        for fd in list(self._pipes):
            self._drop(fd)
        if self._paused is not None:
            self._paused.cancel()

    def _read(self, fd: int) -> None:
        try:
            data = os.read(fd, _READ_BYTES)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if not data:
            self._drop(fd)
            return
        self._pipes[fd](data)
        self._left_bytes -= len(data)
        if self._left_bytes <= 0:
            self._refill()
            if self._left_bytes <= 0 and self._paused is None:
                self._pause()

    def _drop(self, fd: int) -> None:
        del self._pipes[fd]
        self._poll.unregister(fd)
        self._loop.remove_reader(fd)

    def _refill(self) -> None:
        now_s = self._loop.time()
        self._left_bytes = min(self._per_s, self._left_bytes + (now_s - self._filled_s) * self._per_s)
        self._filled_s = now_s

    def _pause(self) -> None:
        for fd in self._pipes:
            self._loop.remove_reader(fd)
        self._paused = self._loop.call_later(_PAUSE_S, self._go_on)

    def _go_on(self) -> None:
        self._paused = None
        self._refill()
        if self._left_bytes <= 0:
            self._pause()
            return
        self._listen()

    def _listen(self) -> None:
        if sys.platform != "win32":
            for fd in self._pipes:
                self._loop.add_reader(fd, self._read, fd)


def _poll(files: Iterable[int]) -> Any:
    """What tells which of them can be read, without waiting."""
    if sys.platform != "win32":
        poll = select.poll()
        for fd in files:
            poll.register(fd, select.POLLIN)
        return poll
    else:
        raise NotImplementedError


class ThreadPump:
    """The same where an event loop reads no pipes (Windows): a thread each, that blocks. What a call wrote last may
    come after its end.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, pipes: Mapping[int, Take], *, bytes_per_s: int) -> None:
        self._loop, self._closed = loop, threading.Event()
        self._pause_s = _READ_BYTES / bytes_per_s
        for fd, take in pipes.items():
            threading.Thread(target=self._run, args=(fd, take), daemon=True, name="function-log").start()

    def drain(self) -> None:
        """Nothing can be read ahead here."""

    def close(self) -> None:
        """Take no more."""
        self._closed.set()

    def _run(self, fd: int, take: Take) -> None:
        while not self._closed.is_set():
            try:
                data = os.read(fd, _READ_BYTES)
                if not data:
                    return
                self._loop.call_soon_threadsafe(self._hand, take, data)
            except (OSError, RuntimeError):  # the pipe or the loop is closed
                return
            if len(data) == _READ_BYTES:
                self._closed.wait(self._pause_s)

    def _hand(self, take: Take, data: bytes) -> None:
        if not self._closed.is_set():
            take(data)


def pump(loop: asyncio.AbstractEventLoop, pipes: Mapping[int, Take], *, bytes_per_s: int) -> LogPump | ThreadPump:
    """The one that works here."""
    if sys.platform == "win32":
        return ThreadPump(loop, pipes, bytes_per_s=bytes_per_s)
    else:
        return LogPump(loop, pipes, bytes_per_s=bytes_per_s)
