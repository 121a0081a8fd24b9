"""A finding of a detector or check about a robot: what, where, how bad, why, and what was expected."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Literal

__all__ = ["SEVERITIES", "Edge", "Finding", "FindingSeverity"]

FindingSeverity = Literal["info", "warning", "error"]
SEVERITIES: tuple[FindingSeverity, ...] = ("info", "warning", "error")


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that is wrong at one place. `key` stays the same from opening to clearing.

    `series` is the metric's name, or a topic, node or stream for what is not about values, or "" for the whole robot.
    `kind` is a check's id or a detector's name; `cause` groups what has one root (offline, silence, battery, heat ...).
    `score` is in [0, 1], 0.5 and above for all that is open. `low` and `high` are the expected band, equal to each
    other only where a single value is expected, and NaN where no band makes sense. Times are epoch seconds.
    """

    robot: str
    series: str
    kind: str
    cause: str
    severity: FindingSeverity
    score: float
    value: float
    low: float
    high: float
    reason: str
    since_s: float

    @property
    def key(self) -> tuple[str, str, str]:
        """What makes two findings the same one."""
        return self.robot, self.series, self.kind

    def as_dict(self) -> dict[str, Any]:
        """Plain values, as JSON takes them but for NaN."""
        return asdict(self)


@dataclass(frozen=True, slots=True)
class Edge:
    """A finding opened, got a new reason or severity, or cleared, at `at_s` by the robot's stamps."""

    change: Literal["opened", "changed", "cleared"]
    finding: Finding
    at_s: float
