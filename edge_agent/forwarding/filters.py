"""What of a channel's samples goes on: a rate limit, a dead-band, live only on demand, metric rows at their own rate.

Pure.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from edge_agent.config.topic_table import Delivery, TopicRule
from metaros.errors import DecodeError

__all__ = ["Deadband", "MetricExtractor", "RateLimiter", "SampleDeadband", "Selector"]

_QUICK = 0.3  # periods between two samples of a source that is much faster than its limit,
_FAST = 3  # where so many come so one after the other: not only after a pause of the network
_ROUNDING = 1e-6  # of a period: what a sum of periods may be off


class RateLimiter:
    """Admits at most `rate_hz` on average, and forgives a sample that is off by up to half a period.

    The forgiveness keeps a source that runs at just the limit, but with jitter, from being halved. Of a source that is
    much faster than the limit the samples are taken that follow the whole periods of the clock, so that those of many
    topics come together: what is done with them (a sync of the disk, a frame, a commit) is then done once for all.
    """

    __slots__ = ("_due_s", "_period_s", "_quick", "_seen_s", "_slack_s")

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz if rate_hz > 0 else 0.0
        self._slack_s = self._period_s / 2
        self._due_s = self._seen_s = -math.inf
        self._quick = 0  # so many samples came soon after the one before

    def admit(self, now_s: float) -> bool:
        """Whether a sample that arrives now goes on."""
        self._quick = self._quick + 1 if now_s - self._seen_s < self._period_s * _QUICK else 0
        self._seen_s = now_s
        admitted = now_s >= self._due_s - self._slack_s
        if admitted:
            late = now_s > self._due_s + self._slack_s
            self._due_s = (now_s if late else self._due_s) + self._period_s
        if self._quick >= _FAST:
            periods = math.ceil((self._due_s - self._slack_s) / self._period_s - _ROUNDING)
            self._due_s = periods * self._period_s + self._slack_s
        return admitted


@dataclass(frozen=True, slots=True)
class _Limit:
    """A live channel's limiter and the rate it was made for."""

    rate_hz: float
    limiter: RateLimiter


class Selector:
    """One channel's decision, sample by sample."""

    __slots__ = ("_demand", "_forward", "_limiter", "_live", "_max_rate_hz", "wanted_hz")

    def __init__(self, rule: TopicRule, delivery: Delivery, *, max_rate_hz: float) -> None:
        self._forward = rule.forward
        self._live = delivery == "live"
        self._max_rate_hz = max_rate_hz
        self._limiter = RateLimiter(max_rate_hz)
        self._demand: _Limit | None = None
        self.wanted_hz: float | None = None  # what viewers asked for, whatever the limit; 0 every sample, None nothing

    @property
    def demand_hz(self) -> float | None:
        """The rate that viewers were granted, None without any."""
        return None if self._demand is None else self._demand.rate_hz

    def demand(self, rate_hz: float | None) -> None:
        """What viewers want now: None nothing, 0 every sample, else at most so many; the table's limit holds too."""
        self.wanted_hz = rate_hz
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


class Deadband:
    """Lets values pass that moved by more than `width` since the last that passed, or after `max_s` (0 = never).

    To become a number, or none (NaN), is a move.
    """

    __slots__ = ("_last", "_max_s", "_passed_s", "_width")

    def __init__(self, width: float, *, max_s: float) -> None:
        self._width = width
        self._max_s = max_s or math.inf
        self._last: tuple[float, ...] = ()
        self._passed_s = -math.inf

    def passes(self, values: tuple[float, ...], now_s: float) -> bool:
        """Whether these go on; then they are what the next are compared with."""
        late = now_s - self._passed_s >= self._max_s
        if self._last and not late and not any(map(self._moved, self._last, values)):
            return False
        self._last, self._passed_s = values, now_s
        return True

    def reset(self) -> None:
        """The next values pass."""
        self._last = ()

    def _moved(self, before: float, after: float) -> bool:
        if before != before or after != after:
            return (before == before) != (after == after)
        return abs(after - before) > self._width


class SampleDeadband:
    """A channel's dead-band over whole samples, by fields that are read straight from CDR."""

    __slots__ = ("_band", "_read")

    def __init__(self, read: Callable[[bytes], tuple[float, ...]], width: float, *, max_s: float) -> None:
        self._read = read
        self._band = Deadband(width, max_s=max_s)

    def passes(self, payload: bytes, now_s: float) -> bool:
        """Whether the sample goes on; one that cannot be read does."""
        try:
            values = self._read(payload)
        except DecodeError:
            return True
        return self._band.passes(values, now_s)

    def reset(self) -> None:
        """The next sample passes."""
        self._band.reset()


class MetricExtractor:
    """Reads a topic's series straight from CDR, at most `rate_hz` times a second, each within its own dead-band."""

    __slots__ = ("_bands", "_limiter", "_read", "series_ids")

    def __init__(
        self,
        series_ids: tuple[int, ...],
        read: Callable[[bytes], tuple[float, ...]],
        *,
        rate_hz: float,
        deadband: float = 0.0,
        deadband_max_s: float = 0.0,
    ) -> None:
        self.series_ids = series_ids
        self._read = read
        self._limiter = RateLimiter(rate_hz)
        self._bands = {series: Deadband(deadband, max_s=deadband_max_s) for series in series_ids if deadband > 0}

    def due(self, now_s: float) -> bool:
        """Whether a sample that arrived at `now_s` is to be read; counts as taken."""
        return self._limiter.admit(now_s)

    def rows(self, payload: bytes, now_s: float) -> list[tuple[int, float]]:
        """(series id, value) of each field; a value that is not there (NaN), or did not move, makes no row.

        Raises:
            DecodeError: the payload is no CDR of the type.
        """
        values = self._read(payload)
        rows = [(series, value) for series, value in zip(self.series_ids, values, strict=True) if value == value]
        if not self._bands:
            return rows
        return [row for row in rows if self._bands[row[0]].passes((row[1],), now_s)]
