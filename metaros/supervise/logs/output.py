"""A child's output on its way to the log: read by the event loop where it can watch a pipe, by a thread elsewhere."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
import threading
from collections.abc import Callable
from typing import IO, Protocol

__all__ = ["Output", "ThreadOutput", "follow"]

_READ_BYTES = 64 * 1024
_LAST_WORDS_S = 0.2


class Output(Protocol):
    """Output that is being followed."""

    def finish(self) -> None:
        """The child is dead: write what is left, and close the pipe. A grandchild that holds it does not delay us."""


def follow(loop: asyncio.AbstractEventLoop, pipe: IO[bytes], write: Callable[[bytes], None]) -> Output:
    """Hand all that comes out of `pipe` to `write`, on the loop's thread."""
    if sys.platform == "win32":  # its loop cannot watch pipes
        return ThreadOutput(loop, pipe, write)
    else:
        return PipeOutput(loop, pipe, write)


if sys.platform != "win32":

    class PipeOutput:
        """Read without blocking whenever the loop says that there is something."""

        def __init__(self, loop: asyncio.AbstractEventLoop, pipe: IO[bytes], write: Callable[[bytes], None]) -> None:
            self._loop, self._pipe, self._write = loop, pipe, write
            os.set_blocking(pipe.fileno(), False)
            loop.add_reader(pipe.fileno(), self._read)

        def _read(self) -> None:
            """Take one piece; at the end of the output stop listening, or the loop would turn for nothing."""
            try:
                data = os.read(self._pipe.fileno(), _READ_BYTES)
            except BlockingIOError:
                return
            if data:
                self._write(data)
            else:
                self._loop.remove_reader(self._pipe.fileno())

        def finish(self) -> None:
            """Read what is left in the pipe."""
            self._loop.remove_reader(self._pipe.fileno())
            with contextlib.suppress(BlockingIOError):
                while data := os.read(self._pipe.fileno(), _READ_BYTES):
                    self._write(data)
            self._pipe.close()


class ThreadOutput:
    """Read by a thread that ends with the pipe."""

    def __init__(self, loop: asyncio.AbstractEventLoop, pipe: IO[bytes], write: Callable[[bytes], None]) -> None:
        self._loop, self._pipe, self._write = loop, pipe, write
        self._pending: list[bytes] = []
        self._lock = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="metaros-output", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        with contextlib.suppress(OSError, ValueError):  # the pipe was closed under us
            while data := os.read(self._pipe.fileno(), _READ_BYTES):
                with self._lock:
                    self._pending.append(data)
                with contextlib.suppress(RuntimeError):  # the loop is closed
                    self._loop.call_soon_threadsafe(self._deliver)

    def _deliver(self) -> None:
        with self._lock:
            pieces, self._pending = self._pending, []
        for piece in pieces:
            self._write(piece)

    def finish(self) -> None:
        """Wait a moment for the last words; the pipe is closed unless a grandchild keeps the thread reading."""
        self._thread.join(_LAST_WORDS_S)
        self._deliver()
        self._write = lambda data: None
        if not self._thread.is_alive():
            self._pipe.close()
