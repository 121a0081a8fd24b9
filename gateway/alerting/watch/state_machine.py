"""The evaluator as a state machine over the log: live or in a replay, the same entries give the same state. One thread
owns it."""

from __future__ import annotations

import logging
import struct
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import orjson

from gateway.alerting.anomaly.detectors.bank import SnapshotError
from gateway.alerting.anomaly.evaluator import Evaluator, EvaluatorConfig
from gateway.alerting.watch.checking import merged
from gateway.alerting.watch.entries import Cycle, Mark, RowsEntry
from gateway.domain.channel import METRIC_STREAM
from gateway.domain.finding import Edge
from gateway.store.alerting.watch_rows import RecentRows

__all__ = ["FACTS", "StateMachine"]

log = logging.getLogger(__name__)

_LENGTH = struct.Struct("<I")
VERSION = 1


def _heartbeat(evaluator: Evaluator, robots: Sequence[str], now_s: float) -> None:
    for robot in robots:
        evaluator.heartbeat(robot, now_s)


FACTS: dict[str, Callable[..., None]] = {  # and "checks", which the state machine keeps itself
    "accept": lambda evaluator, robot, series, kind, value: evaluator.accept(robot, series, kind, value),
    "forget": lambda evaluator, robot: evaluator.forget(robot),
    "gap": lambda evaluator, robot, stream, lost, now_s: evaluator.gap(robot, stream, lost, now_s),
    "heard": _heartbeat,
    "link": lambda evaluator, robot, up, now_s: evaluator.link(robot, up, now_s),
    "node": lambda evaluator, robot, node, state, now_s: evaluator.node(robot, node, state, now_s),
    "rates": lambda evaluator, robot, rates, stamp_s: evaluator.rates(robot, rates, stamp_s),
    "robot": lambda evaluator, robot, cohort: evaluator.robot(robot, cohort=cohort),
}


class StateMachine:
    """Applies log entries to the evaluator."""

    def __init__(self, *, config: EvaluatorConfig | None = None) -> None:
        self._config = config if config is not None else EvaluatorConfig()
        self._changes: Mapping[str, Mapping[str, Any]] = {}  # of the table of checks
        self.evaluator = Evaluator(self._config, checks=merged({}))
        self._slots: dict[str, dict[str, int]] = {}
        self.rows = 0

    def apply(self, cycle: Cycle, taken: Sequence[tuple[RowsEntry, slice]]) -> list[Edge]:
        """One cycle: rows, then facts in their order, then the time. Never raises: a replay would end there again."""
        try:
            return self._apply(cycle, taken)
        except Exception:
            log.exception("a cycle of the evaluator failed; it goes on with the next one")
            return []

    def _apply(self, cycle: Cycle, taken: Sequence[tuple[RowsEntry, slice]]) -> list[Edge]:
        for entry, span in taken:
            self._samples(entry, span)
        for name, *arguments in cycle.facts:
            if name == "checks":
                (self._changes,) = arguments
                self.evaluator.set_checks(merged(self._changes))
                continue
            FACTS[name](self.evaluator, *arguments)
            if name == "forget":
                self._slots.pop(arguments[0], None)
        return self.evaluator.tick(cycle.now_s)

    def slot(self, robot: str, series: str) -> int:
        """The slot of a series; -1 where there is none."""
        return self.evaluator.find(robot, series)

    def dump(self, judged: Mapping[Mark, int]) -> bytes:
        """Everything that the future depends on, and how far rows were judged."""
        head = orjson.dumps([VERSION, [(*mark, seq) for mark, seq in judged.items()], self._changes])
        return b"".join((_LENGTH.pack(len(head)), head, self.evaluator.dump()))

    def load(self, data: bytes) -> dict[Mark, int]:
        """Be what a dump was taken of; SnapshotError: of another version, or damaged."""
        try:
            (length,) = _LENGTH.unpack_from(data)
            start = _LENGTH.size + length
            version, judged, changes = orjson.loads(data[_LENGTH.size : start])
        except (struct.error, ValueError) as error:
            raise SnapshotError("the watch's snapshot is damaged") from error
        if version != VERSION:
            raise SnapshotError(f"the watch's snapshot has version {version}, not {VERSION}")
        self.evaluator = Evaluator.load(data[start:], self._config, checks=merged(changes))
        self._changes = changes
        self._slots.clear()
        return {(robot, stream, epoch): seq for robot, stream, epoch, seq in judged}

    def adopt(self, robot: str, state: bytes, rows: RecentRows) -> int:
        """Go on with a robot as another evaluator had it, and with the rows that came since; how many there are.

        Raises:
            SnapshotError: the state is of another version, or damaged: nothing is known of the robot then.
        """
        self._slots.pop(robot, None)
        self.evaluator.load_robot(robot, state)
        _, done = self.evaluator.judged_s(robot)
        if not len(rows):
            return 0
        judged_s = np.array([done.get(name, -np.inf) for name, _ in rows.series])
        fresh = np.floor(rows.stamps / 1e9) > judged_s[rows.index]
        entry = RowsEntry(
            robot=robot,
            stream_id=METRIC_STREAM,
            epoch=0,
            first_seq=1,
            seq=int(fresh.sum()),
            series=rows.series,
            index=rows.index[fresh],
            stamps=rows.stamps[fresh],
            values=rows.values[fresh],
        )
        self._samples(entry, slice(None))
        return len(entry)

    def forget(self, robot: str) -> None:
        """Another evaluator has the robot."""
        self._slots.pop(robot, None)
        self.evaluator.forget(robot)

    def _samples(self, entry: RowsEntry, span: slice) -> None:
        known = self._slots.setdefault(entry.robot, {})
        slots = np.empty(len(entry.series), np.int64)
        for position, (name, topic) in enumerate(entry.series):
            slot = known.get(name)
            if slot is None:
                slot = self.evaluator.slot(entry.robot, name, topic=topic)
                if slot >= 0:  # else there may be room another time, and names without end
                    known[name] = slot
            slots[position] = slot
        chosen = slots[entry.index[span]]
        stamps, values = entry.stamps[span] / 1e9, entry.values[span]
        if (chosen < 0).any():  # more series than the evaluator takes
            kept = chosen >= 0
            chosen, stamps, values = chosen[kept], stamps[kept], values[kept]
        self.rows += len(chosen)
        self.evaluator.samples(chosen, stamps, values)
