"""What a backtest is asked, and what it says."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from gateway.domain.finding import SEVERITIES, Finding, FindingSeverity

__all__ = ["BacktestRequest", "Fired", "Point", "Report", "SeriesReport", "SimulatedAlert", "grouped"]

NS = 10**9
COOL_DOWN_NS = 600 * NS  # what fires again within it is the same alert
Point = tuple[int, float, float | None, float | None, float]  # stamp_ns, value, low, high, score


@dataclass(frozen=True, slots=True, kw_only=True)
class BacktestRequest:
    """Which history of a robot is judged, and with which checks.

    `series` are names or globs, none for all that are stored. `checks` are changes of checks by their id, with the
    fields that may be changed; `detectors` are the ids of the only checks that are on, none for all that are.
    """

    robot: str
    series: tuple[str, ...] = ()
    start_ns: int
    end_ns: int
    checks: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    detectors: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Fired:
    """A finding that would have opened; `cleared_ns` 0: it was open at the end."""

    finding: Finding
    opened_ns: int
    cleared_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SimulatedAlert:
    """An alert that would have been: findings of one cause, with no more than the cool-down between them."""

    cause: str
    severity: FindingSeverity
    reason: str
    first_ns: int
    last_ns: int  # 0: it was open at the end
    findings: int


@dataclass(frozen=True, slots=True, kw_only=True)
class SeriesReport:
    """A series as the evaluator saw it, in so many points as a plot needs; the band is the one before each point."""

    series: str
    samples: int
    points: tuple[Point, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    """All of it. With `cut` a bound was met: it is about the time up to `end_ns`, and the rest was not looked at."""

    robot: str
    start_ns: int
    end_ns: int
    samples: int
    findings: tuple[Fired, ...]
    alerts: tuple[SimulatedAlert, ...]
    series: tuple[SeriesReport, ...]
    cut: bool = False
    took_s: float = 0.0


def grouped(fired: Iterable[Fired]) -> tuple[SimulatedAlert, ...]:
    """The alerts that the findings would have been, in order of time."""
    groups: list[list[Fired]] = []
    newest: dict[str, list[Fired]] = {}
    for item in sorted(fired, key=lambda one: one.opened_ns):
        group = newest.get(item.finding.cause)
        if group is None or _over_ns(group) + COOL_DOWN_NS < item.opened_ns:
            group = newest[item.finding.cause] = []
            groups.append(group)
        group.append(item)
    return tuple(_would(group) for group in groups)


def _over_ns(group: list[Fired]) -> int:
    """When all of them were over; beyond any time while one is not."""
    return max(item.cleared_ns or 2**63 for item in group)


def _would(group: list[Fired]) -> SimulatedAlert:
    worst = max(group, key=lambda item: (SEVERITIES.index(item.finding.severity), item.finding.score)).finding
    return SimulatedAlert(
        cause=worst.cause,
        severity=worst.severity,
        reason=worst.reason,
        first_ns=group[0].opened_ns,
        last_ns=0 if _over_ns(group) == 2**63 else _over_ns(group),
        findings=len(group),
    )
