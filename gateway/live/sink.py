"""Where a viewer's bytes go: a WebSocket's `SendQueue`, or a queue that a coroutine empties."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Protocol

__all__ = ["QueueSink", "Sink"]

SINK_BYTES = 256 * 1024


class Sink(Protocol):
    """Takes ready-made bytes while its buffer is not full; calls `on_full` and `on_drained` when that changes."""

    on_full: Callable[[], None] | None
    on_drained: Callable[[], None] | None

    def ready(self) -> bool:
        """Whether it takes more now; after a False, `on_drained` is called when it does."""

    def write(self, data: bytes, /) -> None:
        """Take bytes in; only while it is ready. `on_full` is called when it is so no more, be it by this or else."""


class QueueSink:
    """For connections that are written by a coroutine, such as a gRPC stream: at most `limit_bytes` and one block."""

    def __init__(self, *, limit_bytes: int = SINK_BYTES) -> None:
        self.on_full: Callable[[], None] | None = None
        self.on_drained: Callable[[], None] | None = None
        self.waiting_bytes = 0
        self._limit_bytes = limit_bytes
        self._queue: deque[bytes] = deque()
        self._filled = asyncio.Event()
        self._closed = False

    def ready(self) -> bool:
        """Whether it takes more now."""
        return self.waiting_bytes < self._limit_bytes and not self._closed

    def write(self, data: bytes) -> None:
        """Take bytes in."""
        if data and not self._closed:
            self._queue.append(data)
            self.waiting_bytes += len(data)
            self._filled.set()
            if not self.ready():
                self._say_full()

    async def next(self) -> bytes:
        """The oldest that waits; waits for one."""
        while not self._queue:
            self._filled.clear()
            await self._filled.wait()
        data = self._queue.popleft()
        full = not self.ready()
        self.waiting_bytes -= len(data)
        if full and self.ready() and self.on_drained is not None:
            self.on_drained()
        return data

    def close(self) -> None:
        """Take nothing more."""
        self._closed = True
        self._say_full()

    def _say_full(self) -> None:
        if self.on_full is not None:
            self.on_full()
