"""Stored messages one by one in order of their stamps, out of runs that lie across each other. Pure but for loading.

Runs come in order of their first stamp (newest first: of their last one, descending); a run is loaded when the merge
reaches it. What is loaded and not yet given out is bounded in bytes: over that, the run that is needed last forgets its
payloads, and is loaded again when its turn comes.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gateway.domain.channel import Channel
from gateway.store.telemetry.samples import StoredBatch, StoredRun

__all__ = ["HOLD_BYTES", "Load", "Message", "MessageKey", "merged"]

HOLD_BYTES = 64 << 20
MessageKey = tuple[int, int, int, int]  # stamp_ns, stream_id, epoch, seq: where a message is in its robot's history
Load = Callable[[StoredRun], StoredBatch | None]


@dataclass(frozen=True, slots=True)
class Message:
    """One stored message; `payload` is what the robot's node published."""

    channel: Channel
    stream_id: int
    epoch: int
    seq: int
    stamp_ns: int
    receive_ns: int
    payload: bytes

    @property
    def place(self) -> MessageKey:
        """Its place in the order of time, different from that of every other message of its robot."""
        return (self.stamp_ns, self.stream_id, self.epoch, self.seq)


class _Open:
    """A run that has been reached: which of its samples are wanted, in which order, and how far they are given out."""

    __slots__ = ("at", "batch", "ends", "order", "run", "stamps")

    def __init__(self, run: StoredRun, batch: StoredBatch, start_ns: int, end_ns: int, *, newest_first: bool) -> None:
        self.run = run
        self.batch: StoredBatch | None = batch
        self.ends = np.cumsum(batch.lengths, dtype=np.int64)
        stamps: npt.NDArray[np.int64] = batch.stamps_ns
        order = np.argsort(stamps, kind="stable")
        order = order[(stamps[order] >= start_ns) & (stamps[order] <= end_ns)]
        self.order: list[int] = (order[::-1] if newest_first else order).tolist()
        self.stamps: list[int] = stamps[self.order].tolist()
        self.at = 0

    @property
    def size_bytes(self) -> int:
        return len(self.batch.payload) if self.batch is not None else 0

    @property
    def place(self) -> MessageKey:
        run = self.run
        return (self.stamps[self.at], run.stream_id, run.epoch, run.first_seq + self.order[self.at])

    def message(self, batch: StoredBatch) -> Message:
        run, index = self.run, self.order[self.at]
        end = int(self.ends[index])
        payload = batch.payload[end - int(batch.lengths[index]) : end]
        seq = run.first_seq + index
        return Message(batch.channel, run.stream_id, run.epoch, seq, self.stamps[self.at], batch.receive_ns, payload)


def merged(
    runs: Iterable[StoredRun],
    load: Load,
    *,
    start_ns: int,
    end_ns: int,
    newest_first: bool = False,
    hold_bytes: int = HOLD_BYTES,
) -> Iterator[Message]:
    """The runs' messages stamped within the range, both ends included; runs that `load` gives None for are left out."""
    return iter(_Merge(load, start_ns, end_ns, newest_first, hold_bytes).messages(iter(runs)))


class _Merge:
    def __init__(self, load: Load, start_ns: int, end_ns: int, newest_first: bool, hold_bytes: int) -> None:
        self._load = load
        self._start_ns, self._end_ns = start_ns, end_ns
        self._newest_first = newest_first
        self._hold_bytes = hold_bytes
        self._held_bytes = 0
        self._heap: list[tuple[MessageKey, _Open]] = []

    def messages(self, runs: Iterator[StoredRun]) -> Iterator[Message]:
        """Give them out."""
        heap = self._heap
        upcoming = next(runs, None)
        while heap or upcoming is not None:
            while upcoming is not None and (not heap or self._begin(upcoming) <= heap[0][0][0]):
                self._open(upcoming)
                upcoming = next(runs, None)
            if not heap:
                continue
            entry = heap[0][1]
            batch = entry.batch or self._again(entry)
            if batch is None:  # it was there when the merge reached it, and is not any more
                heapq.heappop(heap)
                continue
            yield entry.message(batch)
            entry.at += 1
            if entry.at < len(entry.order):
                heapq.heapreplace(heap, (self._key(entry), entry))
            else:
                heapq.heappop(heap)
                self._held_bytes -= entry.size_bytes

    def _begin(self, run: StoredRun) -> int:
        return -run.last_ns if self._newest_first else run.first_ns

    def _key(self, entry: _Open) -> MessageKey:
        place = entry.place
        return (-place[0], -place[1], -place[2], -place[3]) if self._newest_first else place

    def _open(self, run: StoredRun) -> None:
        batch = self._load(run)
        if batch is None:
            return
        entry = _Open(run, batch, self._start_ns, self._end_ns, newest_first=self._newest_first)
        if entry.order:
            heapq.heappush(self._heap, (self._key(entry), entry))
            self._hold(entry)

    def _again(self, entry: _Open) -> StoredBatch | None:
        entry.batch = self._load(entry.run)
        self._hold(entry)
        return entry.batch

    def _hold(self, entry: _Open) -> None:
        """Count a loaded run, and let those go that are needed last."""
        self._held_bytes += entry.size_bytes
        while self._held_bytes > self._hold_bytes:
            others = [item for item in self._heap if item[1].batch is not None and item[1] is not entry]
            if not others:
                return
            last = max(others, key=lambda item: item[0])[1]
            self._held_bytes -= last.size_bytes
            last.batch = None
