"""What is counted of functions: calls, errors, throttles, cold starts, and how long they took, by minutes.

Durations are kept as counts in steps of 12 %: a percentile of any window costs the same however much was called.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any, Final

from gateway.domain.automation.invocation import OK, THROTTLED, Recorded
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["FunctionMeters", "Stats", "Totals"]

MINUTE_NS: Final = 60 * 10**9
STEP: Final = math.log(1.12)
LEAST_MS: Final = 0.01


@dataclass(slots=True)
class _Minute:
    """One minute of one function."""

    at: int
    invocations: int = 0
    errors: int = 0
    throttles: int = 0
    cold_starts: int = 0
    durations: Counter[int] = field(default_factory=Counter)


@dataclass(slots=True)
class Totals:
    """Of one function since the gateway began: what only grows."""

    invocations: int = 0
    errors: int = 0
    throttles: int = 0
    cold_starts: int = 0
    duration_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Stats:
    """One function over a window; percentiles are None where nothing ran. `series` has a row for each minute."""

    window_s: float
    invocations: int
    errors: int
    throttles: int
    cold_starts: int
    p50_ms: float | None
    p95_ms: float | None
    p99_ms: float | None
    series: tuple[dict[str, Any], ...]


class FunctionMeters:
    """Lives on the event loop; bounded by functions times minutes."""

    def __init__(self, *, clock: Clock, limits: Limits = LIMITS) -> None:
        self._clock = clock
        self._limits = limits
        self._minutes: dict[str, deque[_Minute]] = {}
        self.totals: dict[str, Totals] = {}

    def count(self, call: Recorded, *, again: bool = False) -> None:
        """A call is over; `again`: it was counted before a restart, and is not one since the gateway began."""
        minute = self._minute(call.function, call.began_ns // MINUTE_NS)
        total = Totals() if again else self.totals.setdefault(call.function, Totals())
        if call.status == THROTTLED:
            minute.throttles += 1
            total.throttles += 1
            return
        failed, cold = call.status != OK, call.init_ms > 0
        minute.invocations += 1
        minute.errors += failed
        minute.cold_starts += cold
        minute.durations[_step(call.duration_ms)] += 1
        total.invocations += 1
        total.errors += failed
        total.cold_starts += cold
        total.duration_s += call.duration_ms / 1000

    def learn(self, calls: Iterable[Recorded]) -> None:
        """Calls of before the gateway began, so that its windows are not empty then."""
        for call in calls:
            self.count(call, again=True)

    def stats(self, function: str, *, window_s: float) -> Stats:
        """The newest `window_s`, in whole minutes."""
        first = (self._clock.wall_ns() - round(window_s * 1e9)) // MINUTE_NS + 1
        minutes = [item for item in self._minutes.get(function, ()) if item.at >= first]
        durations: Counter[int] = Counter()
        for item in minutes:
            durations.update(item.durations)
        return Stats(
            window_s=window_s,
            invocations=sum(item.invocations for item in minutes),
            errors=sum(item.errors for item in minutes),
            throttles=sum(item.throttles for item in minutes),
            cold_starts=sum(item.cold_starts for item in minutes),
            p50_ms=_percentile(durations, 0.5),
            p95_ms=_percentile(durations, 0.95),
            p99_ms=_percentile(durations, 0.99),
            series=tuple(_row(item) for item in sorted(minutes, key=lambda item: item.at)),
        )

    def percentiles(self, *, window_s: float) -> dict[float, float]:
        """How long the calls of all functions took in the newest `window_s`, in ms; empty where nothing ran."""
        first = (self._clock.wall_ns() - round(window_s * 1e9)) // MINUTE_NS + 1
        durations: Counter[int] = Counter()
        for minutes in self._minutes.values():
            for item in minutes:
                if item.at >= first:
                    durations.update(item.durations)
        found = {share: _percentile(durations, share) for share in (0.5, 0.95, 0.99)}
        return {share: value for share, value in found.items() if value is not None}

    def forget(self, function: str) -> None:
        """It is gone."""
        self._minutes.pop(function, None)
        self.totals.pop(function, None)

    def _minute(self, function: str, at: int) -> _Minute:
        minutes = self._minutes.get(function)
        if minutes is None:
            minutes = self._minutes[function] = deque(maxlen=self._limits.function_minutes)
        for item in reversed(minutes):
            if item.at == at:
                return item
            if item.at < at:
                break
        minutes.append(_Minute(at))
        return minutes[-1]


def _step(duration_ms: float) -> int:
    return round(math.log(max(duration_ms, LEAST_MS) / LEAST_MS) / STEP)


def _percentile(durations: Counter[int], share: float) -> float | None:
    left = math.ceil(durations.total() * share)
    for step in sorted(durations):
        left -= durations[step]
        if left <= 0:
            return float(f"{LEAST_MS * math.exp(step * STEP):.3g}")
    return None


def _row(minute: _Minute) -> dict[str, Any]:
    return {
        "at_ns": minute.at * MINUTE_NS,
        "invocations": minute.invocations,
        "errors": minute.errors,
        "throttles": minute.throttles,
        "p95_ms": _percentile(minute.durations, 0.95),
    }
