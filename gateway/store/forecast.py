"""Forecasts when the store reaches its bound, and when the disk is full, at the fleet's present rate. Pure.

A class grows by what a day brings until its own bounds hold it: what is deleted by age then is as much as what comes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

__all__ = ["ClassFlow", "Forecast", "days_until", "forecast"]


@dataclass(frozen=True, slots=True, kw_only=True)
class ClassFlow:
    """One class: what it holds, what a day brings, and its bounds; None is none."""

    size_bytes: int
    bytes_per_day: float
    keep_days: float | None = None
    keep_bytes: int | None = None
    local: bool = True  # whether it lies on the disk that may become full

    @property
    def room_bytes(self) -> float:
        """How much it can still grow."""
        most = [float("inf")]
        if self.keep_days is not None:
            most.append(self.keep_days * self.bytes_per_day)
        if self.keep_bytes is not None:
            most.append(self.keep_bytes)
        return max(0.0, min(most) - self.size_bytes)


@dataclass(frozen=True, slots=True)
class Forecast:
    """Days from now; None is never."""

    until_bound: float | None
    until_full: float | None


def days_until(flows: Sequence[ClassFlow], added_bytes: float) -> float | None:
    """When the classes together will have grown by so much; None: never."""
    if added_bytes <= 0:
        return 0.0
    growing = sorted(
        (flow.room_bytes / flow.bytes_per_day, flow.bytes_per_day)
        for flow in flows
        if flow.bytes_per_day > 0 and flow.room_bytes > 0
    )
    rate, now, left = sum(item[1] for item in growing), 0.0, added_bytes
    for end, own_rate in growing:
        if rate * (end - now) >= left:
            return now + left / rate
        left -= rate * (end - now)
        now = end
        rate -= own_rate
    return None


def forecast(flows: Sequence[ClassFlow], *, total_bytes: int, keep_bytes: int, disk_free_bytes: int | None) -> Forecast:
    """When `keep_bytes` is reached and the oldest data begin to go; and when the disk is full, unless that is first."""
    until_bound = days_until(flows, keep_bytes - total_bytes)
    if disk_free_bytes is None:
        return Forecast(until_bound, None)
    until_full = days_until([flow for flow in flows if flow.local], disk_free_bytes)
    if until_full is not None and until_bound is not None and until_bound <= until_full:
        until_full = None
    return Forecast(until_bound, until_full)
