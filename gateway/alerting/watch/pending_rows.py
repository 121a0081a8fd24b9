"""Rows that were handed to the store and are not judged yet. Pure: the same calls leave the same, also in a replay."""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Iterator, Mapping

from gateway.alerting.watch.entries import Mark, RowsEntry

__all__ = ["PendingRows"]

MAX_ROWS = 2_000_000  # 40 MB: what is beyond is left out, the oldest first
MAX_ENTRIES = 100_000  # each takes about as much as fifty rows, however few it has
REMEMBERED_MARKS = 65_536


class PendingRows:
    """Entries by stream and epoch, and up to which number each was judged."""

    def __init__(self, *, max_rows: int = MAX_ROWS) -> None:
        self.judged: OrderedDict[Mark, int] = OrderedDict()
        self.rows = 0
        self.dropped = 0
        self._max_rows = max_rows
        self._waiting: dict[Mark, deque[RowsEntry]] = {}
        self._order: deque[Mark] = deque()  # one for each entry, the oldest first

    def add(self, entry: RowsEntry) -> None:
        """The store is about to commit it."""
        key = entry.mark
        self._waiting.setdefault(key, deque()).append(entry)
        self._order.append(key)
        self.rows += len(entry)
        while self.rows > self._max_rows or len(self._order) > MAX_ENTRIES:
            oldest = self._order.popleft()
            if (waiting := self._waiting.get(oldest)) is not None:
                gone = waiting.popleft()
                self.rows -= len(gone)
                self.dropped += len(gone)
                if not waiting:
                    del self._waiting[oldest]

    def take(self, marks: Mapping[Mark, int]) -> list[tuple[RowsEntry, slice]]:
        """What is committed up to these marks and was not judged: entries and which of their rows, by number.

        What was given up and came again, cut otherwise maybe, is taken once.
        """
        taken: list[tuple[RowsEntry, slice]] = []
        for key, mark in marks.items():
            entries = sorted(self._waiting.pop(key, ()), key=lambda entry: entry.first_seq)
            later = deque(entry for entry in entries if entry.seq > mark)
            if later:
                self._waiting[key] = later
            for entry in entries:
                after = self.judged.get(key, entry.first_seq - 1)
                span = entry.span(after, mark)
                if span.start < span.stop:
                    taken.append((entry, span))
                    self.judged[key] = min(entry.seq, mark)
            self.rows -= sum(len(entry) for entry in entries) - sum(len(entry) for entry in later)
            if key in self.judged:
                self.judged[key] = max(self.judged[key], mark)
                self.judged.move_to_end(key)
        while len(self.judged) > REMEMBERED_MARKS:
            self.judged.popitem(last=False)
        self._forget_order()
        return taken

    def skip(self, marks: Mapping[Mark, int]) -> None:
        """Count everything up to these marks as judged."""
        self.take(marks)
        for key, mark in marks.items():
            self.judged[key] = mark
            self.judged.move_to_end(key)

    def forget(self, robot: str) -> None:
        """Let go of everything of a robot."""
        for key in [key for key in self._waiting if key[0] == robot]:
            self.rows -= sum(len(entry) for entry in self._waiting.pop(key))
        for key in [key for key in self.judged if key[0] == robot]:
            del self.judged[key]
        self._forget_order()

    def entries(self) -> Iterator[RowsEntry]:
        """Everything that waits, in an order that `add` may be called in again."""
        for waiting in self._waiting.values():
            yield from waiting

    def _forget_order(self) -> None:
        """Rebuild the order where it has become much longer than what waits."""
        waiting = sum(len(entries) for entries in self._waiting.values())
        if len(self._order) > 2 * waiting + 64:
            self._order = deque(key for key, entries in self._waiting.items() for _ in entries)
