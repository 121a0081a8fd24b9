"""A streamed answer on its way from a worker to its reader: bounded, paced as AWS paces it, and never waited for."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import Protocol

from metaros.automation.functions.calls import Outcome
from metaros.limits import LIMITS, Limits

__all__ = ["ResponseStream", "Source"]


class Source(Protocol):
    """The connection that the pieces come from."""

    def pause_reading(self) -> None:
        """Let the worker wait."""

    def resume_reading(self) -> None:
        """Let it go on."""


class ResponseStream:
    """Pieces in by `feed`, out by iteration, the call's Outcome last.

    The source is paused while `function_stream_window_bytes` wait for the reader, and for as long as the pieces came
    faster than the pace. A reader that went away (`discard`) stops nothing: the rest is dropped.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, *, limits: Limits = LIMITS) -> None:
        self._loop = loop
        self._window_bytes = limits.function_stream_window_bytes
        self._most_bytes = limits.function_stream_bytes
        self._per_s = limits.function_stream_bytes_per_s
        self._burst_bytes = self._allowed_bytes = float(limits.function_stream_burst_bytes)
        self._filled_s = loop.time()
        self._pieces: deque[bytes] = deque()
        self._waiting_bytes = 0
        self._seen_bytes = 0
        self._outcome: Outcome | None = None
        self._error: Exception | None = None
        self._reader: asyncio.Future[None] | None = None
        self._source: Source | None = None
        self._paced: asyncio.TimerHandle | None = None
        self._paused = False
        self._discarded = False

    @property
    def too_large(self) -> bool:
        """Whether more came than an answer may have."""
        return self._seen_bytes > self._most_bytes

    def begin(self, source: Source) -> None:
        """The pieces come from there."""
        self._source = source

    def feed(self, piece: bytes) -> None:
        """A piece came; what is over the limit is dropped."""
        self._seen_bytes += len(piece)
        if self._discarded or self.too_large or not piece:
            return
        self._pieces.append(piece)
        self._waiting_bytes += len(piece)
        self._wake()
        self._pace(len(piece))
        self._hold()

    def end(self, outcome: Outcome) -> None:
        """Nothing comes any more."""
        if self._paced is not None:
            self._paced.cancel()
            self._paced = None
        self._source = None
        self._outcome = outcome
        self._wake()

    def fail(self, error: Exception) -> None:
        """Nothing comes any more, and nobody knows what it would have been."""
        self._error = error
        self._wake()

    def discard(self) -> None:
        """Nobody reads any more."""
        self._discarded = True
        self._pieces.clear()
        self._waiting_bytes = 0
        self._hold()

    def __aiter__(self) -> ResponseStream:
        return self

    async def __anext__(self) -> bytes | Outcome:
        while not self._pieces:
            if self._discarded:
                raise StopAsyncIteration
            if self._error is not None:
                raise self._error
            if self._outcome is not None:
                self._discarded = True
                return self._outcome
            self._reader = self._loop.create_future()
            await self._reader
        piece = self._pieces.popleft()
        self._waiting_bytes -= len(piece)
        self._hold()
        return piece

    def _wake(self) -> None:
        if self._reader is not None and not self._reader.done():
            self._reader.set_result(None)
        self._reader = None

    def _pace(self, size_bytes: int) -> None:
        now_s = self._loop.time()
        filled = self._allowed_bytes + (now_s - self._filled_s) * self._per_s
        self._allowed_bytes = min(self._burst_bytes, filled) - size_bytes
        self._filled_s = now_s
        if self._allowed_bytes < 0 and self._paced is None:
            self._paced = self._loop.call_later(-self._allowed_bytes / self._per_s, self._pace_over)

    def _pace_over(self) -> None:
        self._paced = None
        self._hold()

    def _hold(self) -> None:
        """Pause or resume the source, as it should be now."""
        full = not self._discarded and self._waiting_bytes >= self._window_bytes
        wanted = full or self._paced is not None
        if self._source is not None and wanted != self._paused:
            self._paused = wanted
            if wanted:
                self._source.pause_reading()
            else:
                self._source.resume_reading()
