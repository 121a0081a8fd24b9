"""A bank of streaming detectors: many series, one fixed parameter set, bounded memory, causal.

Each sample is judged by four novelties before it is learned: the value itself, the mean of the last values less what is
usual at this hour of the day, their range, and the lowest value of a longer while. A novelty's strength is the distance
to the nearest value it has kept, in running standard deviations of its series; a series' score is its strongest novelty
by the one limit, on a scale where 0.5 is the limit. What was reported is kept too: the same odd value is no news twice.
An alert raises the limit for a while, so that series of any kind alert about as often. `stream.py` is the same for one
series in plain Python, and the easier one to read.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from gateway.alerting.anomaly.detectors.page import Page
from gateway.alerting.anomaly.detectors.state import Floats, Rows
from gateway.alerting.anomaly.explanation import Explanation, Learned
from gateway.alerting.anomaly.parameters import FIXED, THRESHOLD, BankConfig
from gateway.alerting.anomaly.snapshot import SnapshotError, pack, unpack

__all__ = ["PAGE_ROWS", "THRESHOLD", "Bank", "BankConfig", "Explanation", "Learned", "SnapshotError"]

PAGE_ROWS = 512  # a call with one page's slots takes a millisecond or two


class Bank:
    """Detectors by slot; slots are small integers that are used again. No clock, no randomness, no input or output."""

    def __init__(self, config: BankConfig = FIXED) -> None:
        self.config = config
        self._pages: list[Page] = []
        self._free: list[int] = []  # the smallest last
        self._used: set[int] = set()
        self._row_bytes = Page(config, 1).state.row_bytes

    def __len__(self) -> int:
        """Slots in use."""
        return len(self._used)

    @property
    def size_bytes(self) -> int:
        """Of all arrays, free rows included."""
        return sum(page.state.size_bytes for page in self._pages)

    def add(self, *, times: float = 1.0) -> int:
        """A slot for a new series; `times` as many standard deviations as by the config make an alert of it."""
        if not 1e-6 < times < 1e6:  # so that no limit becomes 0 or infinite
            raise ValueError(f"times {times}: more than a millionth, less than a million")
        if not self._free:
            start = len(self._pages) * PAGE_ROWS
            self._pages.append(Page(self.config, PAGE_ROWS))
            self._free = list(range(start + PAGE_ROWS - 1, start - 1, -1))
        slot = self._free.pop()
        self._used.add(slot)
        page, row = self._at(slot)
        page.reset(row, times=times)
        return slot

    def free(self, slot: int) -> None:
        """Forget a series."""
        self._used.remove(slot)
        self._free.append(slot)

    def update(self, slots: Rows, stamps_s: Floats, values: Floats) -> Floats:
        """Scores in [0, 1] of one sample for each slot, never NaN; at least THRESHOLD is an alert.

        A slot may come once a call. Stamps are seconds since the epoch, in any order; they say the hour of the day and
        how much time passes. A value or stamp that is no number is ignored: it is counted and scores 0.
        """
        slots = np.asarray(slots, dtype=np.int64)
        stamps_s, values = np.asarray(stamps_s, dtype=np.float64), np.asarray(values, dtype=np.float64)
        scores = np.zeros(len(slots))
        for number, inside in _by_page(slots):
            rows = slots[inside] % PAGE_ROWS
            scores[inside] = self._pages[number].update(rows, stamps_s[inside], values[inside])
        return scores

    def accept(self, slot: int, value: float, stamp_s: float | None = None) -> None:
        """ "This is normal": the value counts as seen, at the hour of the stamp or of the last sample."""
        page, row = self._at(slot)
        page.accept(row, value, stamp_s)

    def learned(self, slot: int) -> Learned:
        """How far the slot's learning is; its scores are 0 until it is over."""
        page, row = self._at(slot)
        return page.learned(row)

    def ignored(self, slot: int) -> int:
        """Samples of the slot that were no number."""
        page, row = self._at(slot)
        return int(page.state["ignored"][row])

    def explain(self, slot: int) -> Explanation:
        """Why the slot's last sample got its score."""
        page, row = self._at(slot)
        return page.explain(row)

    def band(self, slot: int) -> tuple[float, float]:
        """Low and high end of what is expected next, around the last value; both 0 before the first one."""
        page, row = self._at(slot)
        return page.band(row)

    def dump(self, slots: Sequence[int]) -> bytes:
        """A snapshot of slots: their state to the last bit."""
        if not self._used.issuperset(slots):
            raise KeyError(f"slots {sorted(set(slots) - self._used)[:8]} are not in use")
        at = np.array(slots, dtype=np.int64)
        rows = np.empty((len(at), self._row_bytes), dtype=np.uint8)
        for number, inside in _by_page(at):
            rows[inside] = self._pages[number].state.pack(at[inside] % PAGE_ROWS)
        return pack(self.config, rows)

    def load(self, data: bytes) -> list[int]:
        """New slots with the state of a snapshot, in the order it was made with.

        Raises:
            SnapshotError: it is damaged, or of another version or parameter set; nothing was loaded then.
        """
        rows = unpack(self.config, data, row_bytes=self._row_bytes)
        at = np.array([self.add() for _ in rows], dtype=np.int64)
        for number, inside in _by_page(at):
            self._pages[number].state.unpack(at[inside] % PAGE_ROWS, rows[inside])
        return [int(slot) for slot in at]

    def _at(self, slot: int) -> tuple[Page, int]:
        if slot not in self._used:
            raise KeyError(f"slot {slot} is not in use")
        return self._pages[slot // PAGE_ROWS], slot % PAGE_ROWS


def _by_page(slots: Rows) -> Iterator[tuple[int, Rows | slice]]:
    """The number of each page that slots lie in, and where in `slots` those of it are."""
    pages = slots // PAGE_ROWS
    found = np.flatnonzero(np.bincount(pages)).tolist()  # np.unique takes 50 ms to import, once
    if len(found) == 1:
        yield found[0], slice(None)
        return
    for number in found:
        yield number, np.flatnonzero(pages == number)
