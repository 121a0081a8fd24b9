"""Axes of a plot: from values to places, and the round numbers and times that are written beside them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime

__all__ = ["Axis", "number", "time_ticks", "value_ticks"]

S, MINUTE, HOUR, DAY = 1e3, 60e3, 3600e3, 86_400e3
STEPS_MS = (
    *(n * S for n in (1, 2, 5, 10, 15, 30)),
    *(n * MINUTE for n in (1, 2, 5, 10, 15, 30)),
    *(n * HOUR for n in (1, 2, 3, 6, 12)),
    *(n * DAY for n in (1, 2, 5, 7)),
)
MOST_TIMES, VALUES = 10, 3
SMALLEST = 1e-307  # of steps: among the numbers below few are round, and 10 ** -324 is 0


@dataclass(frozen=True, slots=True)
class Axis:
    """Values from `begin` to `end` lie from `left` to `right`, which may be the bottom and the top."""

    begin: float
    end: float
    left: float
    right: float

    def at(self, value: float) -> float:
        """Where a value lies."""
        return self.left + (value - self.begin) / ((self.end - self.begin) or 1.0) * (self.right - self.left)


def value_ticks(axis: Axis) -> Iterator[float]:
    """A few round numbers of an axis, at least one."""
    width = axis.end - axis.begin
    rough = width / VALUES
    if not (math.isfinite(rough) and rough > SMALLEST):
        return
    size = 10.0 ** math.floor(math.log10(rough))
    step = next((size * factor for factor in (1, 2, 5) if size * factor >= rough), size * 10)
    if width < 2 * step:  # one or two would be all
        step /= 2
    first = math.ceil(axis.begin / step)
    yield from (place * step for place in range(first, first + 2 * VALUES + 2) if place * step <= axis.end)


def time_ticks(axis: Axis) -> Iterator[tuple[float, str]]:
    """Round UTC times in ms with what is written there; a day's first is its date."""
    width = axis.end - axis.begin
    step = next((step for step in STEPS_MS if width / step <= MOST_TIMES), STEPS_MS[-1])
    at = math.ceil(axis.begin / step) * step
    while at <= axis.end:
        moment = datetime.fromtimestamp(at / 1e3, UTC)
        midnight = at % DAY == 0
        yield at, f"{moment:%m-%d}" if midnight else f"{moment:%H:%M:%S}" if step < MINUTE else f"{moment:%H:%M}"
        at += step


def number(value: float) -> str:
    """As short as it can be said."""
    if value == 0:
        return "0"
    return f"{value:.4g}" if 1e-3 <= abs(value) < 1e6 else f"{value:.2g}"
