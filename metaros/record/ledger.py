"""What a recording lacks: per publisher, which of its sequence numbers are in the file, which are not, and why. Pure.

A publisher numbers its samples 1, 2, 3 …; a number that is not in the file is `lost` (it never came to the recorder),
`dropped` (the recorder's queue was full), `paused`, or `disk` (the file could not take it). Numbers before the first
one recorded are reported as `before`: the publisher was there before the recorder listened.
"""

from __future__ import annotations

import json
import threading
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

__all__ = ["GAPS", "REASONS", "Ledger", "Publisher", "Ranges"]

GAPS: Final = "metaros.gaps"
REASONS: Final = ("lost", "dropped", "paused", "disk")
_RANGES: Final = 1000  # a publisher and reason; then the last one grows over what lies between


class Ranges:
    """Whole numbers as [first, last] pairs in ascending order; `folded` when some that lie between were included."""

    __slots__ = ("folded", "pairs")

    def __init__(self, pairs: Iterable[list[int]] = ()) -> None:
        self.pairs: list[list[int]] = [list(pair) for pair in pairs]
        self.folded = False

    def add(self, first: int, last: int) -> None:
        """Include first..last; most additions continue the last pair."""
        pairs = self.pairs
        if pairs and pairs[-1][0] <= first <= pairs[-1][1] + 1:
            pairs[-1][1] = max(pairs[-1][1], last)
            return
        if pairs and first < pairs[-1][0]:
            self.pairs = _merged([*pairs, [first, last]])
        else:
            pairs.append([first, last])
        if len(self.pairs) > _RANGES:
            end = self.pairs.pop()
            self.pairs[-1][1] = end[1]
            self.folded = True

    def discard(self, number: int) -> bool:
        """Take one number out; whether it was in."""
        for place in range(len(self.pairs) - 1, -1, -1):
            first, last = self.pairs[place]
            if last < number:
                return False
            if first <= number:
                rest = [[first, number - 1], [number + 1, last]]
                self.pairs[place : place + 1] = [pair for pair in rest if pair[0] <= pair[1]]
                return True
        return False

    def within(self, first: int, last: int) -> list[list[int]]:
        """What lies within first..last."""
        cut = ([max(low, first), min(high, last)] for low, high in self.pairs)
        return [pair for pair in cut if pair[0] <= pair[1]]

    def without(self, other: Iterable[list[int]]) -> Ranges:
        """The numbers that are not in `other`, whose pairs ascend."""
        left = [list(pair) for pair in self.pairs]
        for low, high in other:
            left = [
                piece
                for first, last in left
                for piece in ([first, min(last, low - 1)], [max(first, high + 1), last])
                if piece[0] <= piece[1]
            ]
        return Ranges(_merged(left))

    def count(self) -> int:
        """How many numbers."""
        return sum(last - first + 1 for first, last in self.pairs)


def _merged(pairs: list[list[int]]) -> list[list[int]]:
    merged: list[list[int]] = []
    for first, last in sorted(pairs):
        if merged and first <= merged[-1][1] + 1:
            merged[-1][1] = max(merged[-1][1], last)
        else:
            merged.append([first, last])
    return merged


class Publisher:
    """One publisher of a topic, by its GID. What was refused is noted on one thread and settled on another."""

    __slots__ = ("_lock", "_refused", "gid", "newest", "topic", "type_name")

    def __init__(self, topic: str, type_name: str, gid: bytes) -> None:
        self.topic, self.type_name, self.gid = topic, type_name, gid
        self.newest = 0  # in any file
        self._refused: dict[str, Ranges] = {}
        self._lock = threading.Lock()

    def refuse(self, sequence: int, reason: str) -> None:
        """A sample came, and will not be in the recording."""
        with self._lock:
            self._refused.setdefault(reason, Ranges()).add(sequence, sequence)

    def reasons(self, first: int, last: int) -> dict[str, list[list[int]]]:
        """Why first..last is missing: what was refused by its reason, the rest is lost."""
        rest = Ranges([[first, last]])
        found: dict[str, list[list[int]]] = {}
        with self._lock:
            for reason, refused in self._refused.items():
                if pairs := refused.within(first, last):
                    found[reason] = pairs
                    rest = rest.without(pairs)
        if rest.pairs:
            found["lost"] = rest.pairs
        return found

    def refused(self, after: int) -> tuple[int, int] | None:
        """The lowest and the highest number above `after` that was refused."""
        with self._lock:
            pairs = [pair for ranges in self._refused.values() for pair in ranges.within(after + 1, 1 << 63)]
        return (min(pair[0] for pair in pairs), max(pair[1] for pair in pairs)) if pairs else None


@dataclass(slots=True)
class _Entry:
    first: int
    last: int
    received: int = 0
    again: int = 0
    missing: dict[str, Ranges] = field(default_factory=dict)


class Ledger:
    """The account of one file. With `continues`, the publishers' numbers go on from the file before."""

    def __init__(self, *, continues: bool = True) -> None:
        self._continues = continues
        self._entries: dict[Publisher, _Entry] = {}

    def note(self, publisher: Publisher, sequence: int) -> None:
        """A sample goes into the file."""
        entry = self._entries.get(publisher)
        if entry is None:
            entry = self._open(publisher, sequence)
        if sequence == entry.last + 1:
            entry.last = publisher.newest = sequence
        elif sequence > entry.last:
            self._miss(publisher, entry, entry.last + 1, sequence - 1)
            entry.last = publisher.newest = sequence
        elif not any(ranges.discard(sequence) for ranges in entry.missing.values()):
            entry.again += 1
        entry.received += 1

    def take_back(self, notes: Iterable[tuple[Publisher, int]]) -> None:
        """Samples that were noted did not stay in the file."""
        for publisher, sequence in notes:
            entry = self._entries[publisher]
            entry.received -= 1
            entry.missing.setdefault("disk", Ranges()).add(sequence, sequence)

    def close(self, publishers: Iterable[Publisher]) -> None:
        """The recording ends: what was refused after the last sample counts, too."""
        for publisher in publishers:
            entry = self._entries.get(publisher)
            refused = publisher.refused(entry.last if entry else publisher.newest)
            if refused is None:
                continue
            if entry is None:
                entry = self._open(publisher, refused[1] + 1)
            if refused[1] > entry.last:
                self._miss(publisher, entry, entry.last + 1, refused[1])
                entry.last = publisher.newest = refused[1]

    def counts(self) -> dict[str, dict[str, int]]:
        """By topic: how many samples are missing, by reason."""
        found: dict[str, dict[str, int]] = {}
        for publisher, entry in self._entries.items():
            for reason, ranges in entry.missing.items():
                if number := ranges.count():
                    topic = found.setdefault(publisher.topic, {})
                    topic[reason] = topic.get(reason, 0) + number
        return found

    def record(self) -> dict[str, str]:
        """The metadata record: `topic gid` to JSON. Publishers without a gap are in it, too: that is the proof."""
        return {f"{p.topic} {p.gid.hex()}": json.dumps(_described(p, e)) for p, e in self._entries.items()}

    def _open(self, publisher: Publisher, sequence: int) -> _Entry:
        """Where a publisher's account in this file begins: at its first sample, or at what is missing before it."""
        first = sequence
        if self._continues and sequence > publisher.newest:
            refused = publisher.refused(0)
            first = publisher.newest + 1 if publisher.newest else min(sequence, refused[0] if refused else sequence)
        entry = self._entries[publisher] = _Entry(first, first - 1)
        return entry

    @staticmethod
    def _miss(publisher: Publisher, entry: _Entry, first: int, last: int) -> None:
        for reason, pairs in publisher.reasons(first, last).items():
            ranges = entry.missing.setdefault(reason, Ranges())
            for pair in pairs:
                ranges.add(*pair)


def _described(publisher: Publisher, entry: _Entry) -> Mapping[str, Any]:
    facts: dict[str, Any] = {
        "type": publisher.type_name,
        "first": entry.first,
        "last": entry.last,
        "received": entry.received,
        "before": entry.first - 1,
    }
    if entry.again:
        facts["again"] = entry.again
    for reason in REASONS:
        ranges = entry.missing.get(reason)
        if ranges and ranges.pairs:
            facts[reason] = ranges.pairs
            if ranges.folded:
                facts["folded"] = True
    return facts
