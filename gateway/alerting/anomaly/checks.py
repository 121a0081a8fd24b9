"""What a check is: one row of a table that says which series are looked at, for what, and how it is told.

The rows that come with the product are in `defaults`; what interprets them is `values` (thresholds and changes),
`flat` (frozen values), `presence` (silence and rates), `facts` (what is no metric) and the detectors.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from gateway.domain.finding import FindingSeverity
from metaros.idl.globs import Glob

__all__ = ["Check", "CheckKind", "CheckTable"]

CheckKind = Literal["threshold", "change", "frozen", "silence", "rate", "fact", "detector"]


@dataclass(frozen=True, kw_only=True)
class Check:
    """One row.

    A threshold breaches at `high` and above or `low` and below, and is over when it is `hysteresis` back from there. A
    change is per second over `window_s`. Rates take `low` and `high` as factors of what is usual, and facts with a
    `window_s` take `high` as a count within it. Which fields have a meaning for a row is in `fields`.
    """

    id: str
    title: str
    kind: CheckKind
    cause: str
    series: str = "**"
    unit: str = ""
    enabled: bool = True
    low: float | None = None
    high: float | None = None
    hysteresis: float = 0.0
    for_s: float = 0.0
    clear_s: float = 10.0
    window_s: float = 0.0
    severity: FindingSeverity = "warning"

    def __post_init__(self) -> None:
        for name in ("low", "high", "hysteresis", "for_s", "clear_s", "window_s"):
            value = getattr(self, name)
            if value is not None and not math.isfinite(value):
                raise ValueError(f"check {self.id}: {name} must be a finite number, not {value}")
        if min(self.hysteresis, self.for_s, self.clear_s, self.window_s) < 0.0:
            raise ValueError(f"check {self.id}: hysteresis, for_s, clear_s and window_s must not be negative")
        if self.low is not None and self.high is not None and self.low >= self.high:
            raise ValueError(f"check {self.id}: low must be below high, not {self.low:g} and {self.high:g}")

    @property
    def fields(self) -> tuple[str, ...]:
        """What somebody may set of it: what a row learns by itself, or has no use for, is not to be set."""
        always = ("enabled", "severity")
        if self.kind in ("threshold", "change", "rate"):
            return (*always, "low", "high", "for_s", "clear_s")
        if self.kind != "fact":
            return always
        bound = () if self.high is None else ("high",)
        return (*always, *bound) if self.window_s else (*always, *bound, "for_s", "clear_s")

    @cached_property
    def glob(self) -> Glob:
        """The series' pattern."""
        return Glob(self.series, separator=".")


class CheckTable:
    """The rows in force, by id and by series."""

    def __init__(self, checks: Iterable[Check]) -> None:
        """Raises ValueError where two rows have one id."""
        rows = tuple(checks)
        self.rows = rows
        self._by_id = {check.id: check for check in rows}
        if len(self._by_id) != len(rows):
            raise ValueError("two checks have the same id")

    def get(self, check_id: str) -> Check | None:
        """An enabled row."""
        check = self._by_id.get(check_id)
        return check if check is not None and check.enabled else None

    def named(self, check_id: str) -> Check | None:
        """A row, enabled or not."""
        return self._by_id.get(check_id)

    def of(self, series: str, *kinds: CheckKind) -> list[int]:
        """The numbers of the enabled rows that look at a series."""
        return [
            number
            for number, check in enumerate(self.rows)
            if check.enabled and check.kind in kinds and check.glob.matches(series)
        ]
