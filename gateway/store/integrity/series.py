"""Checks that every chunk of every numeric series can be read, and holds what its row says."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from gateway.store.engine import StoreEngine
from gateway.store.telemetry.chunks import decode

__all__ = ["BadChunk", "bad_chunks"]

_PAGE = 200  # chunks read at a time, each a snapshot of its own
_CHUNKS = (
    "SELECT m.chunk, m.encoding, m.count, m.stamps, m.vals, m.first_ns, m.last_ns, r.id, s.name FROM metric_chunks m"
    " JOIN series s ON s.series = m.series JOIN robots r ON r.robot = s.robot"
    " WHERE m.chunk > ? ORDER BY m.chunk LIMIT ?"
)


class BadChunk(NamedTuple):
    """A chunk that cannot be read, or is another one than its row says."""

    robot: str
    series: str
    first_ns: int
    last_ns: int
    detail: str


def bad_chunks(engine: StoreEngine) -> Iterator[BadChunk]:
    """Read them all through."""
    last = 0
    while True:
        with engine.transaction(write=False):
            rows = engine.fetch(_CHUNKS, last, _PAGE)
        for row in rows:
            detail = _fault(*row[1:7])
            if detail:
                yield BadChunk(row[7], row[8], row[5], row[6], f"chunk {row[0]}: {detail}")
        if len(rows) < _PAGE:
            return
        last = rows[-1][0]


def _fault(encoding: int, count: int, stamps: Any, values: Any, first_ns: int, last_ns: int) -> str:
    try:
        found, numbers = decode([(encoding, count, bytes(stamps), bytes(values))])
    except ValueError as error:
        return str(error)
    if len(found) != count or len(numbers) != count:
        return f"{len(found)} rows, not {count}"
    if (int(found[0]), int(found[-1])) != (first_ns, last_ns):
        return "its stamps are others than its row says"
    return ""
