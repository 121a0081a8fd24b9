"""What the watch shows of itself: how far a series is learned, its expected band, and the table of checks."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["BandPoint", "CheckRow", "SeriesWatch"]


@dataclass(frozen=True, slots=True)
class SeriesWatch:
    """A series of a robot: it is learned while `seen` is less than `of` samples; `low` and `high` are expected now."""

    series: str
    seen: int
    of: int
    score: float
    low: float | None
    high: float | None


@dataclass(frozen=True, slots=True)
class BandPoint:
    """What a series was at a moment, by the robot's clock, and what was expected; None where nothing was yet."""

    stamp_ns: int
    value: float
    low: float | None
    high: float | None
    score: float


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckRow:
    """A check as it is in force. `changed` names the fields that somebody (`by`, at `at_ns`) set otherwise."""

    id: str
    title: str
    unit: str
    enabled: bool
    low: float | None
    high: float | None
    for_s: float
    clear_s: float
    severity: str
    changed: tuple[str, ...] = ()
    by: str = ""
    at_ns: int = 0
