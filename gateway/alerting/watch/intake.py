"""Where the store's writer and the judge meet: rows are logged before they are committed, and judged after it.

So whatever the moment of a kill -9, the log has every row that the store has, and the stored watermarks say which of
the rest were committed as well.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Collection, Mapping, Sequence

from gateway.domain.channel import METRIC_STREAM
from gateway.store import StreamWrite
from gateway.store.writes import Write
from gateway.watch.entries import ROWS, TURN, Mark, RowsEntry, Turn, pack_rows, pack_turn, unpack_rows, unpack_turn
from gateway.watch.keeper import Keeper, Kept
from gateway.watch.mind import Mind
from gateway.watch.pending import Pending
from metaros.link import CHANNEL_MASK

__all__ = ["Intake"]

log = logging.getLogger(__name__)


class Intake:
    """`ahead` on the store's thread, everything else on the judge's."""

    def __init__(self, keeper: Keeper, *, pending: Pending | None = None) -> None:
        self.keeper = keeper
        self.pending = pending if pending is not None else Pending()
        self.on = True
        self._lock = threading.Lock()

    def ahead(self, writes: Sequence[Write]) -> None:
        """These are about to be committed. Never raises: commits matter more than what is made of them."""
        if not self.on:
            return
        try:
            for write in writes:
                if isinstance(write, StreamWrite) and write.rows is not None and _metric(write):
                    self._ahead(write)
        except Exception:
            log.exception("rows are not watched: a mistake of ours")
            self.keeper.whole = False

    def _ahead(self, write: StreamWrite) -> None:
        rows = write.rows
        assert rows is not None
        entry = RowsEntry(
            robot=write.robot,
            stream_id=write.stream_id,
            epoch=write.epoch,
            first_seq=write.first_seq,
            seq=write.seq,
            series=tuple((series.name, series.topic) for series in rows.series),
            index=rows.index,
            stamps=rows.stamps,
            values=rows.values,
        )
        payload = pack_rows(entry) if self.keeper.logs else b""
        with self._lock:
            self.keeper.append(ROWS, payload)
            self.pending.add(entry)

    def turn(self, turn: Turn) -> list[tuple[RowsEntry, slice]]:
        """Log a turn; the rows that it is about."""
        payload = pack_turn(turn) if self.keeper.logs else b""
        with self._lock:
            self.keeper.append(TURN, payload)
            return self.pending.take(turn.marks)

    def skip(self, marks: Mapping[Mark, int]) -> None:
        """Up to these numbers rows were judged, or will be, by other ways than this."""
        with self._lock:
            self.pending.skip(marks)

    def forget(self, robot: str) -> None:
        """A robot's rows are not for this judge."""
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

    def replay(self, kept: Kept, mind: Mind, *, stopped: Callable[[], bool]) -> None:
        """Give the judge everything that it was given before, in the same order."""
        for kind, payload in kept.records():
            if stopped():
                return
            if kind == ROWS:
                entry = unpack_rows(payload)
                with self._lock:
                    self.pending.add(entry)
            elif kind == TURN:
                turn = unpack_turn(payload)
                with self._lock:
                    taken = self.pending.take(turn.marks)
                mind.apply(turn, taken)

    def turn_over(self) -> tuple[int, dict[Mark, int]]:
        """A new log that has what is not judged yet; its snapshot's number, and how far rows were judged."""
        with self._lock:
            number = self.keeper.turn_over((ROWS, pack_rows(entry)) for entry in self.pending.entries())
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
            self.keeper.close()


def _metric(write: StreamWrite) -> bool:
    return write.stream_id & CHANNEL_MASK == METRIC_STREAM
