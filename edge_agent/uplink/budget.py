"""How many bytes a second may leave the robot, and who goes first: a token bucket with a step for each use. Pure.

A use may take what is above its step: events and command results may even overdraw, the others leave something in the
bucket for those before them. Back-fill has a bucket of its own beside it: a share of what the uplink was measured to
carry, so that history never crowds out what happens now.
"""

from __future__ import annotations

from enum import Enum

__all__ = ["BACKFILL_SHARE", "Budget", "Use"]

BACKFILL_SHARE = 0.7
_BURST_S = 0.25
_LEAST_BURST = 64 * 1024
_ENDLESS = 1 << 40
_FIRST_BYTES_PER_S = 1_000_000.0  # back-fill begins here, and finds out
_PROBE = 1.25  # how much faster it tries to be than what was measured
_SPAN_S = 1.0


class Use(Enum):
    """What bytes are for, first come those that matter most; the value is the share of the bucket left alone."""

    EVENT = -1.0
    COMMAND = -0.99
    LIVE = 0.1
    METRIC = 0.25
    BULK = 0.4
    BACKFILL = 0.5


class Budget:
    """One robot's uplink. `limit_bytes_per_s` 0 means no limit."""

    def __init__(self, *, limit_bytes_per_s: int = 0, now_s: float) -> None:
        self.limit_bytes_per_s = limit_bytes_per_s
        self.sent_bytes_per_s = 0.0
        self.backfill_bytes_per_s = _FIRST_BYTES_PER_S
        self._level = float(self._burst)
        self._backfill_level = 0.0
        self._at_s = self._span_s = now_s
        self._span_sent = self._span_backfilled = 0

    @property
    def _burst(self) -> int:
        return max(_LEAST_BURST, round(self.limit_bytes_per_s * _BURST_S))

    def set_limit(self, bytes_per_s: int, now_s: float) -> None:
        """Another limit from now on."""
        self._pass(now_s)
        self.limit_bytes_per_s = bytes_per_s
        self._level = min(self._level, float(self._burst))

    def room(self, use: Use, now_s: float) -> int:
        """How many bytes of this use may go now; what is due in one piece may go where this is above 0."""
        self._pass(now_s)
        room = _ENDLESS if not self.limit_bytes_per_s else int(self._level - use.value * self._burst)
        return min(room, int(self._backfill_level)) if use is Use.BACKFILL else room

    def wait_s(self, use: Use, now_s: float) -> float:
        """Seconds until this use has room again, if nothing else goes meanwhile."""
        self._pass(now_s)
        waits = [0.0]
        if self.limit_bytes_per_s:
            waits.append((1 + use.value * self._burst - self._level) / self.limit_bytes_per_s)
        if use is Use.BACKFILL:
            waits.append((1 - self._backfill_level) / max(self.backfill_bytes_per_s, 1.0))
        return max(waits)

    def spend(self, use: Use, size_bytes: int, now_s: float) -> None:
        """So many bytes went."""
        self._pass(now_s)
        self._span_sent += size_bytes
        if self.limit_bytes_per_s:
            self._level -= size_bytes
        if use is Use.BACKFILL:
            self._backfill_level -= size_bytes

    def backfilled(self, size_bytes: int, now_s: float) -> None:
        """The gateway acknowledged so many bytes of back-fill: what the uplink carries is measured by it."""
        self._pass(now_s)
        self._span_backfilled += size_bytes

    def _pass(self, now_s: float) -> None:
        passed_s = max(0.0, now_s - self._at_s)
        self._at_s = now_s
        if self.limit_bytes_per_s:
            self._level = min(float(self._burst), self._level + passed_s * self.limit_bytes_per_s)
        burst = max(float(_LEAST_BURST), self.backfill_bytes_per_s * _BURST_S)
        self._backfill_level = min(burst, self._backfill_level + passed_s * self.backfill_bytes_per_s)
        span_s = now_s - self._span_s
        if span_s >= _SPAN_S:
            self._measure(span_s)
            self._span_s, self._span_sent, self._span_backfilled = now_s, 0, 0

    def _measure(self, span_s: float) -> None:
        """Learn from the last second: while back-fill got through at its rate, try more; else take its share."""
        self.sent_bytes_per_s = self._span_sent / span_s
        got = self._span_backfilled / span_s
        if not got:
            return
        if got >= 0.8 * self.backfill_bytes_per_s:
            self.backfill_bytes_per_s *= _PROBE
        else:
            self.backfill_bytes_per_s = max(float(_LEAST_BURST), BACKFILL_SHARE * self.sent_bytes_per_s)
