"""What of a channel's samples goes on: a rate limit, live only on demand, metric rows at their own rate. Pure."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from edge_agent.topics import Delivery, TopicRule

__all__ = ["MetricExtractor", "RateLimiter", "Selector"]


class RateLimiter:
    """Admits at most `rate_hz` on average, and forgives a sample that is off by up to half a period.

    The forgiveness keeps a source that runs at just the limit, but with jitter, from being halved.
    """

    __slots__ = ("_due_s", "_period_s", "_slack_s")

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz if rate_hz > 0 else 0.0
        self._slack_s = self._period_s / 2
        self._due_s = -math.inf

    def admit(self, now_s: float) -> bool:
        """Whether a sample that arrives now goes on."""
        if now_s < self._due_s - self._slack_s:
            return False
        late = now_s > self._due_s + self._slack_s
        self._due_s = (now_s if late else self._due_s) + self._period_s
        return True


@dataclass(frozen=True, slots=True)
class _Limit:
    """A live channel's limiter and the rate it was made for."""

    rate_hz: float
    limiter: RateLimiter


class Selector:
    """One channel's decision, sample by sample."""

    __slots__ = ("_demand", "_forward", "_limiter", "_live", "_max_rate_hz")

    def __init__(self, rule: TopicRule, delivery: Delivery, *, max_rate_hz: float) -> None:
        self._forward = rule.forward
        self._live = delivery == "live"
        self._max_rate_hz = max_rate_hz
        self._limiter = RateLimiter(max_rate_hz)
        self._demand: _Limit | None = None

    @property
    def demand_hz(self) -> float | None:
        """The rate that viewers were granted, None without any."""
        return None if self._demand is None else self._demand.rate_hz

    def demand(self, rate_hz: float | None) -> None:
        """What viewers want now: None nothing, 0 every sample, else at most so many; the table's limit holds too."""
        if rate_hz is None:
            self._demand = None
            return
        if rate_hz <= 0 or not math.isfinite(rate_hz):
            rate_hz = self._max_rate_hz
        elif self._max_rate_hz > 0:
            rate_hz = min(rate_hz, self._max_rate_hz)
        if self._demand is None or self._demand.rate_hz != rate_hz:
            self._demand = _Limit(rate_hz, RateLimiter(rate_hz))

    def admit(self, now_s: float) -> bool:
        """Whether a sample that arrived at `now_s` leaves the robot."""
        if not self._forward:
            return False
        if not self._live:
            return self._limiter.admit(now_s)
        return self._demand is not None and self._demand.limiter.admit(now_s)


class MetricExtractor:
    """Reads a topic's series straight from CDR, at most `rate_hz` times a second."""

    __slots__ = ("_limiter", "_read", "series_ids")

    def __init__(
        self, series_ids: tuple[int, ...], read: Callable[[bytes], tuple[float, ...]], *, rate_hz: float
    ) -> None:
        self.series_ids = series_ids
        self._read = read
        self._limiter = RateLimiter(rate_hz)

    def due(self, now_s: float) -> bool:
        """Whether a sample that arrived at `now_s` is to be read; counts as taken."""
        return self._limiter.admit(now_s)

    def rows(self, payload: bytes) -> list[tuple[int, float]]:
        """(series id, value) of each field; a value that is not there (NaN) makes no row.

        Raises:
            DecodeError: the payload is no CDR of the type.
        """
        values = self._read(payload)
        return [(series, value) for series, value in zip(self.series_ids, values, strict=True) if value == value]
