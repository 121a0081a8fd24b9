"""Findings beyond the limit of alerts: they are queued, within a bound, until an alert is resolved."""

from __future__ import annotations

from collections import Counter
from itertools import islice

from gateway.alerting.alerts.causes import TOO_MANY
from gateway.domain.finding import Edge, Finding

__all__ = ["OverflowQueue"]


class OverflowQueue:
    """In the order in which they came; what finds no place here either is counted."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._findings: dict[tuple[str, str, str], Finding] = {}
        self._reported: dict[str, int] = {}  # how many of which robot are known to wait
        self.refused = 0

    def __len__(self) -> int:
        return len(self._findings)

    def add(self, finding: Finding) -> None:
        """One more."""
        if len(self._findings) >= self._most and finding.key not in self._findings:
            self.refused += 1
            return
        self._findings[finding.key] = finding

    def end(self, key: tuple[str, str, str]) -> Finding | None:
        """It is over, or has found room: it, if it waited."""
        return self._findings.pop(key, None)

    def first(self, count: int) -> list[Finding]:
        """Those that wait longest."""
        return list(islice(self._findings.values(), count))

    def news(self, now_ns: int, *, full: bool) -> list[Edge]:
        """What is new to say of how many of each robot wait; of the fleet, "", where it is `full`."""
        each = Counter(finding.robot for finding in self._findings.values())
        waiting = {"": each.total()} if full and each else dict(each)
        gone = [
            Edge("cleared", _crowded(robot, 0, now_ns), now_ns / 1e9)
            for robot in self._reported
            if robot not in waiting
        ]
        more = [(robot, count) for robot, count in waiting.items() if self._reported.get(robot) != count]
        self._reported = waiting
        return [*gone, *(Edge("opened", _crowded(robot, count, now_ns), now_ns / 1e9) for robot, count in more)]


def _crowded(robot: str, count: int, now_ns: int) -> Finding:
    """What says that so many findings wait: of a robot, or "" of the fleet."""
    whose = "the robot" if robot else "the fleet"
    return Finding(
        robot=robot,
        series="",
        kind=TOO_MANY,
        cause=TOO_MANY,
        severity="warning",
        score=1.0,
        value=float(count),
        low=0.0,
        high=0.0,
        reason=f"{count} findings wait for room: {whose} has as many alerts as can be",
        since_s=now_ns / 1e9,
    )
