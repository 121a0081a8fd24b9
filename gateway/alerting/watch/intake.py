"""The write-ahead log of rows: logged before the store commits them, evaluated after it.

So whatever the moment of a kill -9, the log has every row that the store has, and the stored watermarks say which of
the rest were committed as well.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Collection, Mapping, Sequence

from gateway.alerting.watch.entries import (
    CYCLE,
    ROWS,
    Cycle,
    Mark,
    RowsEntry,
    pack_cycle,
    pack_rows,
    unpack_cycle,
    unpack_rows,
)
from gateway.alerting.watch.pending_rows import PendingRows
from gateway.alerting.watch.state_machine import StateMachine
from gateway.alerting.watch.watch_files import Recovered, WatchFiles
from gateway.domain.channel import METRIC_STREAM, Series
from gateway.domain.sample import Rows
from gateway.store import StreamWrite
from gateway.store.writes import Write
from metaros.link import CHANNEL_MASK

__all__ = ["Intake"]

log = logging.getLogger(__name__)
Names = tuple[tuple[str, str], ...]
REMEMBERED_SETS = 1 << 12  # each is kept alive by it


class Intake:
    """`ahead` on the store's thread, everything else on the evaluator's."""

    def __init__(self, files: WatchFiles, *, pending: PendingRows | None = None) -> None:
        self.files = files
        self.pending = pending if pending is not None else PendingRows()
        self.on = True
        self._lock = threading.Lock()
        self._names: dict[int, tuple[tuple[Series, ...], Names]] = {}  # of series that came together

    def ahead(self, writes: Sequence[Write]) -> None:
        """These are about to be committed. Never raises: commits matter more than what is made of them."""
        if not self.on:
            return
        try:
            entries = [
                self._entry(write, write.rows)
                for write in writes
                if isinstance(write, StreamWrite) and write.rows is not None and _metric(write)
            ]
            payloads = [pack_rows(entry) for entry in entries] if self.files.logs else []
            with self._lock:
                self.files.append(ROWS, *payloads)
                for entry in entries:
                    self.pending.add(entry)
        except Exception:
            log.exception("rows are not watched: a mistake of ours")
            self.files.whole = False

    def _entry(self, write: StreamWrite, rows: Rows) -> RowsEntry:
        series = self._names.get(id(rows.series))
        if series is None or series[0] is not rows.series:
            if len(self._names) >= REMEMBERED_SETS:
                self._names.clear()
            series = self._names[id(rows.series)] = rows.series, tuple((item.name, item.topic) for item in rows.series)
        return RowsEntry(
            robot=write.robot,
            stream_id=write.stream_id,
            epoch=write.epoch,
            first_seq=write.first_seq,
            seq=write.seq,
            series=series[1],
            index=rows.index,
            stamps=rows.stamps,
            values=rows.values,
        )

    def log_cycle(self, cycle: Cycle) -> list[tuple[RowsEntry, slice]]:
        """Log a cycle; the rows that it is about."""
        payload = pack_cycle(cycle) if self.files.logs else b""
        with self._lock:
            self.files.append(CYCLE, payload)
            return self.pending.take(cycle.marks)

    def skip(self, marks: Mapping[Mark, int]) -> None:
        """Up to these numbers rows were judged, or will be, by other ways than this."""
        with self._lock:
            self.pending.skip(marks)

    def forget(self, robot: str) -> None:
        """A robot's rows are not for this evaluator."""
        with self._lock:
            self.pending.forget(robot)

    def judged(self, robots: Collection[str]) -> dict[str, dict[tuple[int, int], int]]:
        """Of some robots, up to which number each stream and epoch was judged."""
        found: dict[str, dict[tuple[int, int], int]] = {robot: {} for robot in robots}
        with self._lock:
            for (robot, stream, epoch), seq in self.pending.judged.items():
                if robot in found:
                    found[robot][stream, epoch] = seq
        return found

    def replay(self, kept: Recovered, state_machine: StateMachine, *, stopped: Callable[[], bool]) -> None:
        """Give the evaluator everything that it was given before, in the same order."""
        for kind, payload in kept.records():
            if stopped():
                return
            if kind == ROWS:
                entry = unpack_rows(payload)
                with self._lock:
                    self.pending.add(entry)
            elif kind == CYCLE:
                cycle = unpack_cycle(payload)
                with self._lock:
                    taken = self.pending.take(cycle.marks)
                state_machine.apply(cycle, taken)

    def rotate(self) -> tuple[int, dict[Mark, int]]:
        """A new log that has what is not judged yet; its snapshot's number, and how far rows were judged."""
        with self._lock:
            number = self.files.rotate((ROWS, pack_rows(entry)) for entry in self.pending.entries())
            return number, dict(self.pending.judged)

    def restore(self, judged: Mapping[Mark, int]) -> None:
        """How far rows were judged, of a snapshot."""
        with self._lock:
            self.pending.judged.update(judged)

    def committed(self, stored: Mapping[Mark, int]) -> dict[Mark, int]:
        """Of the watermarks in the store those that rows wait for: they were committed, and nobody was told."""
        with self._lock:
            waiting = {entry.mark for entry in self.pending.entries()}
        return {mark: seq for mark, seq in stored.items() if mark in waiting}

    def clear(self) -> None:
        """Nothing is known of what was judged."""
        with self._lock:
            self.pending.judged.clear()

    def close(self) -> None:
        """Take nothing any more."""
        with self._lock:
            self.on = False
            self.files.close()


def _metric(write: StreamWrite) -> bool:
    return write.stream_id & CHANNEL_MASK == METRIC_STREAM
