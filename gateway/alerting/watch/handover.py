"""Hands the evaluator's state of robots over between gateways. All methods on the evaluator's thread."""

from __future__ import annotations

import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass

from gateway.alerting.anomaly.detectors.bank import SnapshotError
from gateway.alerting.anomaly.detectors.robot_state import VERSION
from gateway.alerting.watch.evaluation import EvaluationThread
from gateway.alerting.watch.intake import Intake
from gateway.store.alerting.watch_rows import RecentRows
from gateway.store.alerting.watch_states import Saved
from metaros.limits import LIMITS

__all__ = ["BACK_NS", "Handover", "ReplayWindow"]

log = logging.getLogger(__name__)

BACK_NS = 60 * 10**9  # how far behind the robot's newest row a series' rows may come
AHEAD_NS = 600 * 10**9  # how far beyond what has passed its stamps may be
FIRST_NS, LAST_NS = -(2**63), 2**63 - 1  # of all stamps: SQL takes no others


@dataclass(frozen=True, slots=True)
class ReplayWindow:
    """The stamps of the rows that are to be judged after a state, both included; `skipped_s` before them are not."""

    start_ns: int
    end_ns: int
    skipped_s: float = 0.0

    @classmethod
    def after(cls, saved: Saved | None, now_ns: int) -> ReplayWindow:
        """What may have come since a state was saved; nothing where none was."""
        if saved is None or not saved.version or not saved.newest_ns:
            return cls(1, 0)
        passed_ns = max(0, now_ns - saved.saved_ns)
        end_ns = saved.newest_ns + passed_ns
        first_ns = end_ns - round(LIMITS.watch_replay_s * 1e9)
        start_ns = max(saved.newest_ns - BACK_NS, first_ns)
        skipped_s = max(0, start_ns - saved.newest_ns) / 1e9
        return cls(max(start_ns, FIRST_NS), min(end_ns + AHEAD_NS, LAST_NS), skipped_s)


class Handover:
    """Between the evaluator and the stored states."""

    def __init__(self, evaluation: EvaluationThread, intake: Intake) -> None:
        self._evaluation = evaluation
        self._intake = intake
        self._large: set[str] = set()  # whose state is too large to be saved
        self.replayed = 0
        self.skipped = 0

    def adopt(self, saved: Saved, rows: RecentRows, window: ReplayWindow, *, since_s: float, now_s: float) -> None:
        """Judge a robot from now on: as it was saved, then what came since, which the next cycle judges.

        `since_s`: since when this gateway could have heard of it.
        """
        state_machine, robot = self._evaluation.state_machine, saved.robot
        if saved.version:
            self._intake.skip({(robot, *key): seq for key, seq in rows.marks.items()})
            self._load(saved, rows, window)
        else:
            state_machine.forget(robot)
        if robot not in state_machine.evaluator.robots():
            state_machine.evaluator.heartbeat(robot, now_s)
        state_machine.evaluator.waited(robot, since_s)

    def _load(self, saved: Saved, rows: RecentRows, window: ReplayWindow) -> None:
        robot = saved.robot
        try:
            count = self._evaluation.state_machine.adopt(robot, saved.state, rows)
        except SnapshotError as error:
            log.warning("what was learned of robot %s is not known here, and it is learned anew: %s", robot, error)
            return
        self.replayed += count
        if rows.left_out or window.skipped_s:
            self.skipped += 1
            log.warning(
                "robot %s was judged by nobody for a while: %.0f s and %d rows of it are not judged",
                robot,
                window.skipped_s,
                rows.left_out,
            )

    def dump(self, fences: Mapping[str, int], *, most_bytes: float, now_ns: int) -> list[Saved]:
        """The states of some robots, until they have so many bytes together; of the first one in any case."""
        evaluator, judged = self._evaluation.state_machine.evaluator, self._intake.judged(fences.keys())
        states: list[Saved] = []
        size_bytes = 0
        for robot, fence in fences.items():
            if size_bytes >= most_bytes:
                break
            state = evaluator.dump_robot(robot)
            version = VERSION if self._fits(robot, len(state)) else 0
            newest_s, _ = evaluator.judged_s(robot)
            made = Saved(
                robot=robot,
                fence=fence,
                version=version,
                saved_ns=now_ns,
                newest_ns=min(max(round(newest_s * 1e9), FIRST_NS), LAST_NS) if math.isfinite(newest_s) else 0,
                marks=judged[robot],
                state=state if version else b"",
            )
            states.append(made)
            size_bytes += len(made.state)
        return states

    def forget(self, robot: str) -> None:
        """Another gateway judges the robot."""
        self._intake.forget(robot)
        self._evaluation.state_machine.forget(robot)
        self._large.discard(robot)

    def _fits(self, robot: str, size_bytes: int) -> bool:
        if size_bytes <= LIMITS.watch_state_bytes:
            self._large.discard(robot)
            return True
        if robot not in self._large:
            most = LIMITS.watch_state_bytes
            log.warning("what is learned of robot %s stays here: it has %d bytes of %d", robot, size_bytes, most)
            self._large.add(robot)
        return False
