"""The evaluation thread: restores, runs cycles, answers queries, writes snapshots. All methods are on that thread."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from gateway.alerting.anomaly.detectors.bank import SnapshotError
from gateway.alerting.anomaly.detectors.rates import RATE_SERIES
from gateway.alerting.watch.bands import Bands
from gateway.alerting.watch.entries import Cycle, Mark, RowsEntry
from gateway.alerting.watch.intake import Intake
from gateway.alerting.watch.rows import BandPoint, SeriesWatch
from gateway.alerting.watch.state_machine import StateMachine
from gateway.domain.finding import Edge
from metaros.clock import Clock

__all__ = ["EvaluationThread"]

log = logging.getLogger(__name__)

SNAPSHOT_S = 900.0
RETRY_S = 60.0
MAX_SHOWN = 4096


class EvaluationThread:
    """Owns the evaluator; `stop` may be set from any thread, and ends a replay."""

    def __init__(
        self,
        intake: Intake,
        bands: Bands,
        *,
        clock: Clock,
        make: Callable[[], StateMachine] = StateMachine,
        kept: bool = True,
    ) -> None:
        """Without `kept` no snapshot is written: each robot's state is kept elsewhere."""
        self.state_machine = make()
        self.stop = False
        self.snapshot_ns = 0  # when the newest was written, by the wall clock
        self.snapshot_bytes = 0
        self._intake = intake
        self._bands = bands
        self._clock = clock
        self._make = make
        self._kept = kept
        self._due_s = clock.monotonic_s() + SNAPSHOT_S
        self._tried_s = -math.inf

    def restore(self, stored: Mapping[Mark, int]) -> dict[Mark, int]:
        """Be what the evaluator of the former run was; the watermarks that nobody was told of any more."""
        kept = self._intake.files.load()
        try:
            if kept.snapshot is not None:
                self._intake.restore(self.state_machine.load(kept.snapshot))
            self._intake.replay(kept, self.state_machine, stopped=lambda: self.stop)
        except SnapshotError as error:
            log.warning("the watch begins anew: %s", error)
            self._begin_anew()
        except Exception:
            log.exception("the watch begins anew: what it had kept cannot be gone through")
            self._begin_anew()
        if len(kept.logs) > 1:  # many short runs: the next start must not go through all of them again
            self._due_s = self._clock.monotonic_s() + RETRY_S
        return self._intake.committed(stored)

    def run_cycle(self, cycle: Cycle) -> list[Edge]:
        """Judge what is committed and known by now; what opened, changed or cleared."""
        taken = self._intake.log_cycle(cycle)
        edges = self.state_machine.apply(cycle, taken)
        self._bands.add(self._points(taken))
        self._keep_sometimes()
        return edges

    def open(self, robot: str | None = None) -> list[Edge]:
        """Everything that is open now, as if it had just opened."""
        now_s = self._clock.wall_ns() / 1e9
        return [Edge("opened", finding, now_s) for finding in self.state_machine.evaluator.open(robot)]

    def robots(self) -> list[str]:
        """Who is known, and was not told as offline."""
        evaluator = self.state_machine.evaluator
        away = {finding.robot for finding in evaluator.open() if finding.kind == "offline"}
        return [robot for robot in evaluator.robots() if robot not in away]

    def learning(self, robot: str) -> list[SeriesWatch]:
        """The series of a robot, by name; the rates of its topics are learned otherwise, and not shown."""
        evaluator, found = self.state_machine.evaluator, []
        metrics = [(name, slot) for name, slot in evaluator.series(robot) if not name.startswith(RATE_SERIES)]
        for name, slot in metrics[:MAX_SHOWN]:
            learned, (low, high) = evaluator.learned(slot), evaluator.band(slot)
            score = evaluator.score(slot)
            found.append(SeriesWatch(name, learned.seen, learned.of, score, _number(low), _number(high)))
        return found

    def _points(self, taken: Sequence[tuple[RowsEntry, slice]]) -> list[tuple[tuple[str, str], BandPoint]]:
        """The newest row of each wanted series, with what was expected."""
        wanted, evaluator = self._bands.wanted(), self.state_machine.evaluator
        newest: dict[tuple[str, str], tuple[int, float]] = {}
        for entry, span in taken:
            names = wanted.get(entry.robot)
            if not names:
                continue
            for position, (name, _) in enumerate(entry.series):
                if name in names and len(at := np.flatnonzero(entry.index[span] == position)):
                    last = at[-1]
                    newest[entry.robot, name] = (int(entry.stamps[span][last]), float(entry.values[span][last]))
        points = []
        for (robot, name), (stamp_ns, value) in newest.items():
            slot = evaluator.find(robot, name)
            if slot >= 0 and math.isfinite(value):
                low, high = evaluator.band(slot)
                point = BandPoint(stamp_ns, value, _number(low), _number(high), evaluator.score(slot))
                points.append(((robot, name), point))
        return points

    def _keep_sometimes(self) -> None:
        """A snapshot, where it is time for one."""
        now_s = self._clock.monotonic_s()
        if (now_s < self._due_s and not self._intake.files.full) or now_s - self._tried_s < RETRY_S:
            return
        self._tried_s = now_s
        self.keep()

    def keep(self) -> int:
        """Write a snapshot; how many bytes it has, 0 where the disk takes none, or none is kept."""
        if not self._kept:
            return 0
        number, judged = self._intake.rotate()
        data = self.state_machine.dump(judged) if number else b""
        if not number or not self._intake.files.save(number, data):
            return 0
        self._due_s = self._clock.monotonic_s() + SNAPSHOT_S
        self.snapshot_ns, self.snapshot_bytes = self._clock.wall_ns(), len(data)
        return len(data)

    def _begin_anew(self) -> None:
        self.state_machine = self._make()
        self._intake.clear()
        self._due_s = -math.inf  # a snapshot soon: the logs of the former run are not to be gone through again


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
