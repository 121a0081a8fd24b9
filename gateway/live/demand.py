"""What viewers want of each robot's live topics, and when it is sent to the robot. Pure.

More is sent at once; less only after it has been less for `hold_s`, so that a page that reloads costs nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

__all__ = ["DemandTable", "merge_rates"]


def merge_rates(rates: Iterable[float]) -> float:
    """The rate that serves all: 0 (every sample) if anybody wants that, else the highest."""
    wanted = list(rates)
    return 0.0 if any(rate <= 0 for rate in wanted) else max(wanted, default=0.0)


def _more(one: float, other: float) -> bool:
    """Whether the first rate is more than the second; 0 is everything."""
    if other <= 0:
        return False
    return one <= 0 or one > other


class DemandTable:
    """By robot and topic: what is wanted now, and what was sent to the robot."""

    def __init__(self, *, hold_s: float = 2.0) -> None:
        self._hold_s = hold_s
        self._wanted: dict[str, dict[str, float]] = {}
        self._sent: dict[str, dict[str, float]] = {}
        self._less_since_s: dict[tuple[str, str], float] = {}

    def want(self, robot: str, wanted: Mapping[str, float], *, now_s: float) -> None:
        """Viewers want this of the robot now."""
        self._wanted[robot] = dict(wanted)
        sent = self._sent.get(robot, {})
        for topic, rate in sent.items():
            less = topic not in wanted or _more(rate, wanted[topic])
            if less:
                self._less_since_s.setdefault((robot, topic), now_s)
            else:
                self._less_since_s.pop((robot, topic), None)

    def forget(self, robot: str) -> None:
        """The robot's link is new or gone: nothing was sent on it."""
        for topic in self._sent.pop(robot, {}):
            self._less_since_s.pop((robot, topic), None)

    def due(self, robot: str, *, now_s: float) -> dict[str, float] | None:
        """What to send to the robot now; None when nothing changed."""
        sent = self._sent.get(robot, {})
        demand = dict(self._wanted.get(robot, {}))
        for topic, rate in sent.items():
            since_s = self._less_since_s.get((robot, topic))
            if since_s is None:
                continue
            if now_s - since_s < self._hold_s:
                demand[topic] = rate
            else:
                del self._less_since_s[robot, topic]
        if demand == sent:
            return None
        self._sent[robot] = demand
        return dict(demand)

    def sent(self, robot: str) -> dict[str, float]:
        """What was sent to the robot last: topic -> rate (0: every sample)."""
        return dict(self._sent.get(robot, {}))

    def releasing(self) -> set[str]:
        """Robots that will soon be asked for less."""
        return {robot for robot, _ in self._less_since_s}
