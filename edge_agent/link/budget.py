"""How many bytes a second may leave the robot, and who goes first: a token bucket with a step for each use. Pure.

A use may take what is above its step in the bucket, so that something is left for those before it; what is due goes
in one piece where there is any room, and the rest waits until that is paid. Results of commands never wait, and
events have a bucket of their own, so that no debt of others holds them up; what they take is missing in the common one.

Back-fill has a bucket beside it: a share of what the uplink carries, so that history never crowds out what happens now.
What it carries is measured: while acknowledgements keep up the rate doubles; when they fall behind and come later than
they could, what was acknowledged is what the link carries. Now and then it tries more for a second, and pays back what
that took.
"""

from __future__ import annotations

import math
from enum import Enum

__all__ = ["BACKFILL_SHARE", "Budget", "Use"]

BACKFILL_SHARE = 0.7
_BURST_S = 0.05
_LEAST_BURST = 16 * 1024
_ENDLESS = 1 << 40
_FIRST_BYTES_PER_S = 250_000.0
_LEAST_BYTES_PER_S, _MOST_BYTES_PER_S = 4_000.0, 1e9
_SILENT_BYTES_PER_S = 16_000.0  # silence is no measurement: by it alone the estimate falls no lower
_SPAN_S, _LONGEST_SPAN_S = 1.0, 30.0
_SPAN_PIECES = 8  # a span is as long as so many of its largest pieces take, or it would see one of them only
_PROBE, _PROBE_EVERY = 1.5, 10  # tries so much more than what the link is known to carry, once in so many spans
_BEHIND = 0.2  # of what was sent: when so much more was sent than acknowledged,
_LATE, _LATE_S = 1.2, 0.1  # and the last of it took so much longer than the shortest time, the link is full
_BUSY = 0.8  # of what was allowed: less was sent because there was no more, which says nothing about the link
_LEAST_WAIT_S = 0.001


class Use(Enum):
    """What bytes are for, first come those that matter most; the value is the share of the bucket left alone."""

    COMMAND = -1.0
    EVENT = 0.0
    LIVE = 0.1
    METRIC = 0.25
    RECORDING = 0.3  # somebody waits for it: before the bulk that never ends, within back-fill's share
    BULK = 0.4
    BACKFILL = 0.5


_SHARED = (Use.RECORDING, Use.BACKFILL)  # what goes out of back-fill's own bucket


class Budget:
    """One robot's uplink. `limit_bytes_per_s` 0 means no limit."""

    def __init__(self, *, limit_bytes_per_s: int = 0, now_s: float) -> None:
        self.limit_bytes_per_s = limit_bytes_per_s
        self.sent_bytes_per_s = 0.0
        self.uplink_bytes_per_s = _FIRST_BYTES_PER_S  # what the link is known to carry of back-fill
        self._level = self._event_level = float(self._burst)
        self._backfill_level = 0.0
        self._at_s = self._span_s = self._second_s = now_s
        self._sent = self._backfill_spent = 0  # in this span, as all that follow
        self._backfill_taken = self._backfill_acked = self._largest = 0
        self._shortest_s, self._delay_s = math.inf, 0.0  # from sending to acknowledgement: the shortest, the last
        self._density = 1.0  # bytes on the wire for one in the outbox: compression, and what frames add
        self._finding = True  # doubles until the link is full
        self._spans = 0  # of back-fill since the last try
        self._trying = False

    @property
    def backfill_bytes_per_s(self) -> float:
        """How fast back-fill may go now."""
        rate = self.uplink_bytes_per_s
        if not self._finding:
            rate *= _PROBE if self._trying else BACKFILL_SHARE
        return min(rate, BACKFILL_SHARE * self.limit_bytes_per_s) if self.limit_bytes_per_s else rate

    @property
    def _burst(self) -> int:
        return max(_LEAST_BURST, round(self.limit_bytes_per_s * _BURST_S))

    def set_limit(self, bytes_per_s: int, now_s: float) -> None:
        """Another limit from now on; 0 for none."""
        self._pass(now_s)
        self.limit_bytes_per_s = bytes_per_s
        self._level = self._event_level = float(self._burst)

    def new_link(self, now_s: float) -> None:
        """Another connection, perhaps over another network: what back-fill owed the old one is forgotten."""
        self._pass(now_s)
        self.uplink_bytes_per_s = max(self.uplink_bytes_per_s, _FIRST_BYTES_PER_S)
        self._finding, self._trying = True, False
        self._shortest_s, self._backfill_level = math.inf, 0.0
        self._span_s = self._at_s
        self._backfill_spent = self._backfill_taken = self._backfill_acked = self._largest = 0

    def room(self, use: Use, now_s: float) -> int:
        """How many bytes of this use may go now; what is due in one piece may go where this is above 0."""
        self._pass(now_s)
        if use in _SHARED:
            return min(self._shared_room(use), int(self._backfill_level))
        return self._shared_room(use)

    def wait_s(self, use: Use, now_s: float) -> float:
        """Seconds until this use has room again if nothing else goes meanwhile; 0 where it has, else never 0."""
        if self.room(use, now_s) > 0:
            return 0.0
        waits = [_LEAST_WAIT_S]
        if self.limit_bytes_per_s:
            level = self._event_level if use is Use.EVENT else self._level
            waits.append((1 + use.value * self._burst - level) / self.limit_bytes_per_s)
        if use in _SHARED:
            waits.append((1 - self._backfill_level) / self.backfill_bytes_per_s)
        return max(waits)

    def spend(self, use: Use, size_bytes: int, now_s: float) -> None:
        """So many bytes went."""
        self._pass(now_s)
        self._sent += size_bytes
        if self.limit_bytes_per_s:
            self._level -= size_bytes
            if use in (Use.EVENT, Use.COMMAND):
                self._event_level -= size_bytes
        if use in _SHARED:
            self._backfill_level -= size_bytes
            self._backfill_spent += size_bytes

    def backfill_taken(self, size_bytes: int, now_s: float) -> None:
        """So many bytes of back-fill left the outbox for the link; what goes out for them is spent apart."""
        self._pass(now_s)
        self._backfill_taken += size_bytes
        self._largest = max(self._largest, size_bytes)

    def backfilled(self, size_bytes: int, now_s: float, *, delay_s: float) -> None:
        """The gateway acknowledged so many of the bytes taken, the newest of them `delay_s` after that."""
        self._pass(now_s)
        self._backfill_acked += size_bytes
        self._largest = max(self._largest, size_bytes)
        self._delay_s = delay_s
        self._shortest_s = min(self._shortest_s, delay_s)

    def _shared_room(self, use: Use) -> int:
        if not self.limit_bytes_per_s or use is Use.COMMAND:
            return _ENDLESS
        level = self._event_level if use is Use.EVENT else self._level
        return int(level - use.value * self._burst)

    def _pass(self, now_s: float) -> None:
        passed_s = max(0.0, now_s - self._at_s)
        self._at_s = max(now_s, self._at_s)
        if self.limit_bytes_per_s:
            more, burst = passed_s * self.limit_bytes_per_s, float(self._burst)
            self._level = min(burst, self._level + more)
            self._event_level = min(burst, self._event_level + more)
        rate = self.backfill_bytes_per_s
        self._backfill_level = min(max(_LEAST_BURST, rate * _BURST_S), self._backfill_level + passed_s * rate)
        self._end_spans()

    def _end_spans(self) -> None:
        if (span_s := self._at_s - self._second_s) >= 1.0:
            self.sent_bytes_per_s = self._sent / span_s
            self._second_s, self._sent = self._at_s, 0
        span_s = self._at_s - self._span_s
        pieces_s = min(_SPAN_PIECES * self._largest / self.uplink_bytes_per_s, _LONGEST_SPAN_S)
        if span_s >= _SPAN_S and (span_s >= pieces_s or (self._finding and self._backfill_acked)):
            if self._largest:
                self._learn(span_s)
            self._span_s = self._at_s
            self._backfill_spent = self._backfill_taken = self._backfill_acked = self._largest = 0

    def _learn(self, span_s: float) -> None:
        """What the last span of back-fill says of the link."""
        taken, acked, allowed = self._backfill_taken, self._backfill_acked, self.backfill_bytes_per_s
        if taken and self._backfill_spent:
            self._density = self._backfill_spent / taken
        came = self._density * acked / span_s
        late = self._delay_s > _LATE * self._shortest_s + _LATE_S
        tried, self._trying = self._trying, False
        self._spans += 1
        if taken - acked > max(_BEHIND * taken, _LEAST_BURST) and (late or not acked):
            self._finding = not acked  # nothing came back: begin again from below
            silent = max(self.uplink_bytes_per_s / 2, min(self.uplink_bytes_per_s, _SILENT_BYTES_PER_S))
            self._set_uplink(came or silent)
            self._backfill_level = min(
                self._backfill_level, BACKFILL_SHARE * self.uplink_bytes_per_s * span_s - self._backfill_spent
            )
        elif 0.8 * came > self.uplink_bytes_per_s:
            self._set_uplink(0.8 * came)  # what was on its way came in: the link carries more than was known
        elif self._backfill_spent < _BUSY * allowed * span_s or allowed == BACKFILL_SHARE * self.limit_bytes_per_s:
            return
        elif tried or self._finding:
            self._finding = True
            self._set_uplink(2 * self.uplink_bytes_per_s)
        elif self._spans >= _PROBE_EVERY:
            self._spans, self._trying = 0, True

    def _set_uplink(self, bytes_per_s: float) -> None:
        self.uplink_bytes_per_s = min(max(bytes_per_s, _LEAST_BYTES_PER_S), _MOST_BYTES_PER_S)
