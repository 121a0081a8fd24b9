"""Pages of a stamped log: forwards and backwards from a place, with a text to look for. Reads files; blocks.

A cursor is a place in all that was ever written. It outlives the turning over of the file; what is gone is skipped.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from metaros.errors import ConfigError
from metaros.limits import LIMITS
from metaros.supervise.logs.file import HEAD_BYTES, base_of

__all__ = ["MOST_BYTES", "Page", "read_page"]

MOST_BYTES: Final = LIMITS.node_answer_bytes
LEAST_BYTES: Final = 256  # of a page; one line fits always
SCAN_BYTES: Final = LIMITS.node_log_scan_bytes  # looked through for one page
QUERY_CHARS: Final = 256
_PIECE: Final = 64 * 1024
_STAMP: Final = len("2026-01-01T00:00:00.000000Z")


@dataclass(frozen=True, slots=True)
class Page:
    """Lines, oldest first, and where to go on in the same direction."""

    lines: tuple[tuple[int, str], ...]  # time in nanoseconds, text
    cursor: str
    more: bool  # there is more in that direction now

    def as_json(self) -> dict[str, Any]:
        """As the control protocol and a command's result have it."""
        return {
            "lines": [{"at_ns": at_ns, "text": text} for at_ns, text in self.lines],
            "cursor": self.cursor,
            "more": self.more,
        }


def read_page(
    path: Path, *, cursor: str = "", max_bytes: int = MOST_BYTES, query: str = "", backwards: bool = False
) -> Page:
    """One page. Without a cursor: the newest lines; the cursor then is their end, or with `backwards` their begin.

    Raises:
        ConfigError: no such cursor, or too long a query.
    """
    if len(query) > QUERY_CHARS:
        raise ConfigError(f"query: at most {QUERY_CHARS} characters")
    if cursor and not (cursor.isascii() and cursor.isdigit() and len(cursor) <= 20):
        raise ConfigError("cursor: not one of this log")
    room = min(max(max_bytes or MOST_BYTES, LEAST_BYTES), MOST_BYTES)
    span = Span(path)
    place = min(max(int(cursor), span.begin), span.end) if cursor else span.end
    if backwards or not cursor:
        found, begin = _older(span, place, room, query)
        return Page(tuple(found), str(begin if backwards else span.end), backwards and begin > span.begin)
    found, end = _newer(span, place, room, query)
    return Page(tuple(found), str(end), end < span.end)


class Span:
    """The log and the one before it as one row of bytes, heads left out of it; `begin` and `end` are places."""

    def __init__(self, path: Path) -> None:
        self._parts: list[tuple[int, int, Path]] = []  # begin, end, file
        for part in (path.with_name(path.name + ".1"), path):
            base = base_of(part)
            if base is not None:
                self._parts.append((base + HEAD_BYTES, base + part.stat().st_size, part))
        self.begin = self._parts[0][0] if self._parts else 0
        self.end = max((end for _, end, _ in self._parts), default=0)

    def parts(self, begin: int, end: int) -> list[tuple[int, bytes]]:
        """The bytes between two places, with the place of each piece."""
        found = []
        for first, last, path in self._parts:
            low, high = max(first, begin), min(last, end)
            if low < high:
                try:
                    with path.open("rb") as file:
                        file.seek(low - first + HEAD_BYTES)
                        found.append((low, file.read(high - low)))
                except OSError:
                    continue
        return found


def _newer(span: Span, place: int, room: int, query: str) -> tuple[list[tuple[int, str]], int]:
    found: list[tuple[int, str]] = []
    scanned = 0
    while place < span.end and scanned < SCAN_BYTES:
        before = place
        for at, data in span.parts(place, min(place + _PIECE, span.end)):
            whole = data.rfind(b"\n") + 1
            place = at
            for line in _split(data[:whole]):
                if (entry := _entry(line, query)) is not None:
                    if found and room < len(line):
                        return found, place
                    room -= len(line)
                    found.append(entry)
                place += len(line)
        scanned += place - before
        if place == before:  # a line that is not whole yet, or heads alone
            jumped = [at for at, _ in span.parts(place, span.end) if at > place]
            if not jumped:
                break
            place = jumped[0]
    return found, place


def _older(span: Span, place: int, room: int, query: str) -> tuple[list[tuple[int, str]], int]:
    found: list[tuple[int, str]] = []
    scanned = 0
    while place > span.begin and scanned < SCAN_BYTES:
        before = place
        for at, data in reversed(span.parts(max(place - _PIECE, span.begin), place)):
            skip = 0 if _is_begin(span, at) else data.find(b"\n") + 1
            lines = _split(data[skip : data.rfind(b"\n") + 1])
            place = at + data.rfind(b"\n") + 1
            for line in reversed(lines):
                if (entry := _entry(line, query)) is not None:
                    if found and room < len(line):
                        return found[::-1], place
                    room -= len(line)
                    found.append(entry)
                place -= len(line)
        scanned += before - place
        if place >= before:
            break
    return found[::-1], place


def _split(data: bytes) -> list[bytes]:
    """Whole lines; a carriage return in one ends none."""
    return [line + b"\n" for line in data.split(b"\n")[:-1]]


def _is_begin(span: Span, place: int) -> bool:
    return any(place == first for first, _, _ in span._parts)


def _entry(line: bytes, query: str) -> tuple[int, str] | None:
    text = line.decode(errors="replace").rstrip("\n")
    body = text[_STAMP + 1 :]
    if query and query.casefold() not in body.casefold():
        return None
    return _time_ns(text[:_STAMP]), body


def _time_ns(text: str) -> int:
    try:
        at = datetime.strptime(text, "%Y-%m-%dT%H:%M:%S.%fZ").replace(tzinfo=UTC)
    except ValueError:
        return 0
    return int(at.replace(microsecond=0).timestamp()) * 1_000_000_000 + at.microsecond * 1000
