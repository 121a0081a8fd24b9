"""The bank of novelties beside robots: a single odd value is a score, not an alert.

At a robot's rates every manoeuvre has a value that was never seen exactly so. A novelty is told only when the series
also stays outside of all it was seen at for some seconds, and is over when it is back for a minute.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gateway.alerting.anomaly.detectors.bank import PAGE_ROWS, THRESHOLD, Bank, BankConfig, SnapshotError
from gateway.alerting.anomaly.detectors.cells import Second
from gateway.alerting.anomaly.detectors.columns import Bools, Columns, Floats, Ints

__all__ = ["Novelties", "NoveltyVerdict"]


@dataclass(frozen=True, slots=True)
class NoveltyVerdict:
    """Places in the second where a novelty is told or over."""

    places: Ints
    opened: Bools


class Novelties:
    """The bank's slots of our slots, their newest scores, and what is told."""

    def __init__(self, config: BankConfig, *, novel_s: float, need: int, clear: int = 60) -> None:
        self.bank = Bank(config)
        self._novel_s, self._need, self._clear = novel_s, need, clear
        self.columns = Columns(
            bank=np.int64(-1), score=np.float64(0), novel_s=np.float64(-np.inf), past=np.int32(0), inside=np.int32(0),
            open=np.bool_(False),
        )  # fmt: skip

    def add(self, slot: int) -> None:
        """A new series."""
        self.columns["bank"][slot] = self.bank.add()

    def free(self, slots: Ints) -> None:
        """These series are gone."""
        for number in self.columns["bank"][slots].tolist():
            if number >= 0:
                self.bank.free(number)
        self.columns.reset(slots)

    def feed(self, second: Second, low: Floats, high: Floats) -> NoveltyVerdict:
        """Score a second's marks; `low` and `high` are all that each series was seen at."""
        columns, slots, at_s = self.columns, second.slots, second.at_s
        scores = self._scores(columns["bank"][slots], second)
        columns["score"][slots] = scores
        novel_s = np.where(scores >= THRESHOLD, at_s, columns["novel_s"][slots])
        columns["novel_s"][slots] = novel_s
        outside = (second.mean < low) | (second.mean > high)
        past = np.where(outside, columns["past"][slots] + 1, 0)
        columns["past"][slots] = np.minimum(past, 2**20)
        was = columns["open"][slots]
        inside = np.where(outside, 0, columns["inside"][slots] + 1)
        columns["inside"][slots] = np.minimum(inside, 2**20)
        opened = ~was & (past >= self._need) & (np.abs(at_s - novel_s) <= self._novel_s)
        closed = was & (inside >= self._clear)
        columns["open"][slots] = (was | opened) & ~closed
        places = np.flatnonzero(opened | closed)
        return NoveltyVerdict(places, opened[places])

    def _scores(self, numbers: Ints, second: Second) -> Floats:
        scores = np.empty(len(numbers))
        for start in range(0, len(numbers), 4 * PAGE_ROWS):
            part = slice(start, start + 4 * PAGE_ROWS)
            scores[part] = self.bank.update(numbers[part], second.stamp_s[part], second.mark[part])
        return scores

    def take(self, slots: Ints) -> bytes:
        """What the bank has of those of some slots that it has, in their order."""
        numbers = self.columns["bank"][slots]
        return self.bank.dump(numbers[numbers >= 0].tolist())

    def put(self, slots: Ints, data: bytes) -> None:
        """Have for these slots what `take` gave. Raises SnapshotError; also where it is of others than the bank has."""
        held = slots[self.columns["bank"][slots] >= 0]
        numbers = self.bank.load(data)
        gone = self.columns["bank"][held].tolist() if len(numbers) == len(held) else numbers
        for number in gone:
            self.bank.free(number)
        if gone is numbers:
            raise SnapshotError(f"{len(numbers)} series in the bank's snapshot, not {len(held)}")
        self.columns["bank"][held] = numbers

    def dump(self) -> dict[str, Mapping[str, npt.NDArray[Any]]]:
        """All state."""
        used = np.flatnonzero(self.columns["bank"] >= 0)
        data = self.bank.dump(self.columns["bank"][used].tolist())
        return {
            "novelties": self.columns.dump(),
            "novelties.bank": {"used": used, "data": np.frombuffer(data, np.uint8)},
        }

    def load(self, parts: Mapping[str, Mapping[str, npt.NDArray[Any]]]) -> None:
        """Take over what `dump` gave. Raises ValueError, KeyError and SnapshotError."""
        self.columns.load(parts["novelties"])
        numbers = self.bank.load(parts["novelties.bank"]["data"].tobytes())
        self.columns["bank"][:] = -1
        self.columns["bank"][parts["novelties.bank"]["used"]] = numbers
