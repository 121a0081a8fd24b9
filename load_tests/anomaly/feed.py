"""From simulated robots to the judge: the same calls that a gateway makes, a second at a time."""

from __future__ import annotations

import numpy as np

from gateway.alerting.anomaly.evaluator import Evaluator
from gateway.domain.finding import Edge
from load_tests.anomaly.robots import FAST, FAST_TOPICS, HOST_TOPICS, RATES_HZ, SERIES, SLOW, Seconds

__all__ = ["EPOCH_S", "Feed", "robot_name"]

EPOCH_S = 1_700_000_000.0


def robot_name(number: int) -> str:
    """As it enrolled."""
    return f"robot_{number:02d}"


class Feed:
    """Puts seconds into a judge; counts rows."""

    def __init__(self, evaluator: Evaluator, robots: int, *, rng: np.random.Generator) -> None:
        self.evaluator, self.robots, self._rng, self.rows = evaluator, robots, rng, 0
        for number in range(robots):
            evaluator.robot(robot_name(number), cohort="simulated")
        named = [
            [evaluator.slot(robot_name(n), series.name, topic=series.topic) for series in SERIES] for n in range(robots)
        ]
        self._slots = np.array(named, np.int64)
        self._fast_topic = np.array([FAST_TOPICS.index(series.topic) for series in FAST])
        self._slow_topic = np.array([HOST_TOPICS.index(series.topic) for series in SLOW])

    def second(self, seconds: Seconds, second: float) -> list[Edge]:
        """Feed one second, stamped from EPOCH_S + `second` on, and judge what is complete."""
        at_s = EPOCH_S + second
        steps = len(seconds.fast)
        phase = (np.arange(steps) + 0.5)[:, None] / steps + self._rng.uniform(-0.2, 0.2, (steps, self.robots)) / steps
        there = seconds.fast_there[:, :, self._fast_topic]
        step, robot, place = np.nonzero(there)
        self._add(self._slots[robot, place], at_s + phase[step, robot], seconds.fast[there])
        there = seconds.slow_there[:, self._slow_topic]
        robot, place = np.nonzero(there)
        self._add(self._slots[robot, len(FAST) + place], np.full(len(robot), at_s + 0.5), seconds.slow[there])
        on = seconds.slow_there[:, 0]
        for number in np.flatnonzero(on).tolist():
            self.evaluator.rates(
                robot_name(number), dict(zip(RATES_HZ, seconds.rates_hz[number].tolist(), strict=True)), at_s + 0.6
            )
            self.evaluator.heartbeat(robot_name(number), at_s + 1.0)
        return self.evaluator.tick(at_s + 1.0)

    def _add(self, slots: np.ndarray, stamps_s: np.ndarray, values: np.ndarray) -> None:
        self.rows += len(slots)
        self.evaluator.samples(slots, stamps_s, values)
