"""What functions print: the newest lines in memory, and whoever follows them live. All methods on the event loop."""

from __future__ import annotations

import asyncio
from collections import OrderedDict, deque
from collections.abc import AsyncGenerator
from dataclasses import dataclass
from typing import Protocol

from gateway.errors import TooManyError
from metaros.limits import LIMITS, Limits

__all__ = ["LogBuffer", "LogLine", "Piece"]

LINE_CHARS = 4096  # a longer line is cut
OVERHEAD_BYTES = 200  # of a line besides its text
BATCH = 256


class Piece(Protocol):
    """What the engine tells: whole lines of one worker."""

    @property
    def function(self) -> str:
        """Whose."""

    @property
    def version(self) -> str:
        """Which of its versions."""

    @property
    def request_id(self) -> str:
        """Of the call, "" between two."""

    @property
    def at_ns(self) -> int:
        """When, ns since the epoch."""

    @property
    def text(self) -> str:
        """The lines."""


@dataclass(frozen=True, slots=True)
class LogLine:
    """One line; `cursor` grows from line to line of all functions, from the gateway's start on."""

    cursor: int
    function: str
    version: str
    request_id: str
    at_ns: int
    text: str


class LogBuffer:
    """A bounded number of lines of each function, and of bytes of all."""

    def __init__(self, *, limits: Limits = LIMITS) -> None:
        self._limits = limits
        self._lines: OrderedDict[str, deque[LogLine]] = OrderedDict()  # that which spoke last is last
        self._bytes = 0
        self._last = 0
        self._news: dict[str, asyncio.Event] = {}
        self._readers = 0
        self._over = False

    def add(self, piece: Piece) -> None:
        """A function said something."""
        lines = self._lines.setdefault(piece.function, deque())
        self._lines.move_to_end(piece.function)
        for text in piece.text.splitlines():
            self._last += 1
            line = LogLine(self._last, piece.function, piece.version, piece.request_id, piece.at_ns, text[:LINE_CHARS])
            lines.append(line)
            self._bytes += _size(line)
        self._bound(lines)
        news = self._news.pop(piece.function, None)
        if news is not None:
            news.set()

    def page(self, function: str, *, limit: int, before: int | None = None) -> list[LogLine]:
        """The newest lines that are in memory, the oldest of them first; `before` is a cursor to go back from."""
        lines = self._lines.get(function, ())
        found = [line for line in lines if before is None or line.cursor < before]
        return found[-limit:]

    async def follow(self, function: str, *, after: int | None = None) -> AsyncGenerator[list[LogLine], None]:
        """What follows a cursor (None: from now on), until `end`. Raises TooManyError where too many follow already."""
        if self._readers >= self._limits.function_log_streams:
            raise TooManyError(f"{self._limits.function_log_streams} follow the logs of functions already")
        self._readers += 1
        try:
            cursor = self._last if after is None else after
            while not self._over:
                news = self._news.setdefault(function, asyncio.Event())  # from before the look
                fresh = [line for line in self._lines.get(function, ()) if line.cursor > cursor][:BATCH]
                if fresh:
                    cursor = fresh[-1].cursor
                    yield fresh
                else:
                    await news.wait()
        finally:
            self._readers -= 1

    def forget(self, function: str) -> None:
        """It is gone."""
        self._bytes -= sum(map(_size, self._lines.pop(function, ())))

    def end(self) -> None:
        """The gateway goes down."""
        self._over = True
        for news in self._news.values():
            news.set()
        self._news.clear()

    def _bound(self, lines: deque[LogLine]) -> None:
        while len(lines) > self._limits.function_log_lines:
            self._bytes -= _size(lines.popleft())
        while self._bytes > self._limits.function_log_bytes:
            function, oldest = next(iter(self._lines.items()))
            if not oldest:
                del self._lines[function]
                continue
            self._bytes -= _size(oldest.popleft())


def _size(line: LogLine) -> int:
    return len(line.text) + OVERHEAD_BYTES
