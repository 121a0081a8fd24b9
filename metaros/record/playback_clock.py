"""When each record of a log is due: the log's own times, scaled. Pure: the caller passes the time."""

from __future__ import annotations

import math

from metaros.errors import ConfigError

__all__ = ["PlaybackClock"]


class PlaybackClock:
    """Maps log seconds to seconds of the caller's clock; `rate` 0 is full speed, 1 the original, 20 twenty-fold."""

    def __init__(self, rate: float) -> None:
        if not math.isfinite(rate) or rate < 0.0:
            raise ConfigError(f"rate must be 0 (full speed) or a positive factor, not {rate}")
        self._rate = rate
        self._log_start_s: float | None = None
        self._clock_start_s = 0.0

    def wait_s(self, log_s: float, *, now_s: float) -> float:
        """How long to wait before a record of log time `log_s`; the first one is due at once."""
        if self._rate == 0.0:
            return 0.0
        if self._log_start_s is None:
            self._log_start_s, self._clock_start_s = log_s, now_s
        return max(0.0, self._clock_start_s + (log_s - self._log_start_s) / self._rate - now_s)

    def shift(self, seconds: float) -> None:
        """Everything is due so much later: it was paused for so long."""
        self._clock_start_s += seconds
