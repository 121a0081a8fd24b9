"""Numbered samples for fault campaigns, and what outlives a kill -9: a journal of what was accepted, and counters.

Every sample is a number: which life of the robot made it, and a count within that life. Its whole payload follows from
the number, so that the store can be checked byte by byte. Both files are written without a sync: a kill takes nothing
from the page cache, and nobody here pulls a plug.
"""

from __future__ import annotations

import mmap
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

__all__ = ["COUNTERS", "KINDS", "Counters", "Entry", "Journal", "number_of", "payload", "read_journal"]

KINDS = ("bulk", "event", "metric")
LOST = -1
_HEAD = struct.Struct("<QI")
_ENTRY = struct.Struct("<QIQqI")


def number_of(life: int, count: int) -> int:
    """A sample's number; also exact as a float64."""
    return life << 28 | count


def payload(kind: int, number: int) -> bytes:
    """The bytes of a sample; their length varies with the number."""
    head = _HEAD.pack(number, kind)
    size = _HEAD.size + (number * 0x9E3779B1 >> 8) % 400
    return (head * (size // _HEAD.size + 1))[:size]


def number_in(data: bytes) -> int:
    """The number that a payload says it has."""
    return int(_HEAD.unpack_from(data)[0]) if len(data) >= _HEAD.size else -2


class Entry(NamedTuple):
    """A run of accepted samples: sequence numbers from `first_seq` hold the samples from `first_number`, or LOST."""

    epoch: int
    stream_id: int
    first_seq: int
    first_number: int
    count: int


class Journal:
    """Appends what was accepted, one write a flush."""

    def __init__(self, path: Path) -> None:
        self._file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)

    def write(self, entries: list[Entry]) -> None:
        """Append entries."""
        os.write(self._file, b"".join(_ENTRY.pack(*entry) for entry in entries))

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)


def read_journal(path: Path) -> Iterator[Entry]:
    """All whole entries."""
    data = path.read_bytes() if path.exists() else b""
    for offset in range(0, len(data) - _ENTRY.size + 1, _ENTRY.size):
        yield Entry(*_ENTRY.unpack_from(data, offset))


COUNTERS = (*KINDS, "online", "sessions", "ack_ns", "accept_ns", "retry_later", "refused", "held", "session_number")


class Counters:
    """A few numbers in a mapped file: the robot writes, the campaign reads, at any moment."""

    def __init__(self, path: Path, *, life: int) -> None:
        """`life` picks the page; an earlier life's numbers stay."""
        self._offset = life * 8 * len(COUNTERS)
        end = self._offset + 8 * len(COUNTERS)
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            if os.fstat(descriptor).st_size < end:
                os.ftruncate(descriptor, end + 64 * 1024)
            self._map = mmap.mmap(descriptor, 0)
        finally:
            os.close(descriptor)

    def __getitem__(self, name: str) -> int:
        return int.from_bytes(self._map[(at := self._at(name)) : at + 8], "little")

    def __setitem__(self, name: str, value: int) -> None:
        at = self._at(name)
        self._map[at : at + 8] = value.to_bytes(8, "little")

    def close(self) -> None:
        """Unmap."""
        self._map.close()

    def _at(self, name: str) -> int:
        return self._offset + 8 * COUNTERS.index(name)
