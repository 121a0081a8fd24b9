"""What viewers want of each robot's live topics, and when the robot is told. Pure.

More is told at once; less only after it has been less for `hold_s`, so that a page that reloads costs nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

__all__ = ["DemandBook", "merge_rates"]


def merge_rates(rates: Iterable[float]) -> float:
    """The rate that serves all: 0 (every sample) if anybody wants that, else the highest."""
    wanted = list(rates)
    return 0.0 if any(rate <= 0 for rate in wanted) else max(wanted, default=0.0)


def _more(one: float, other: float) -> bool:
    """Whether the first rate is more than the second; 0 is everything."""
    if other <= 0:
        return False
    return one <= 0 or one > other


class DemandBook:
    """By robot and topic: what is wanted now, and what the robot was told."""

    def __init__(self, *, hold_s: float = 2.0) -> None:
        self._hold_s = hold_s
        self._wanted: dict[str, dict[str, float]] = {}
        self._told: dict[str, dict[str, float]] = {}
        self._less_since_s: dict[tuple[str, str], float] = {}

    def want(self, robot: str, wanted: Mapping[str, float], *, now_s: float) -> None:
        """Viewers want this of the robot now."""
        self._wanted[robot] = dict(wanted)
        told = self._told.get(robot, {})
        for topic, rate in told.items():
            less = topic not in wanted or _more(rate, wanted[topic])
            if less:
                self._less_since_s.setdefault((robot, topic), now_s)
            else:
                self._less_since_s.pop((robot, topic), None)

    def forget(self, robot: str) -> None:
        """The robot's link is new or gone: it was told nothing."""
        for topic in self._told.pop(robot, {}):
            self._less_since_s.pop((robot, topic), None)

    def due(self, robot: str, *, now_s: float) -> dict[str, float] | None:
        """What to tell the robot now; None when it knows."""
        told = self._told.get(robot, {})
        demand = dict(self._wanted.get(robot, {}))
        for topic, rate in told.items():
            since_s = self._less_since_s.get((robot, topic))
            if since_s is None:
                continue
            if now_s - since_s < self._hold_s:
                demand[topic] = rate
            else:
                del self._less_since_s[robot, topic]
        if demand == told:
            return None
        self._told[robot] = demand
        return dict(demand)

    def told(self, robot: str) -> dict[str, float]:
        """What the robot was told last: topic -> rate (0: every sample)."""
        return dict(self._told.get(robot, {}))

    def releasing(self) -> set[str]:
        """Robots that will soon be told to send less."""
        return {robot for robot, _ in self._less_since_s}
