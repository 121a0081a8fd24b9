"""How far the peer's wall clock is from ours, from heartbeats: the exchange with the least round trip is believed.

Each side sends Heartbeat{sent, echo, held}: its wall time, the peer's last `sent` it received, and how long ago that
was. The receiver gets round trip = now - echo - held, and offset = sent + round trip / 2 - now, with an error of at
most half the round trip. Own times are monotonic, so that setting our clock changes nothing; a peer that sets its
clock is noticed because the new offset contradicts the old one by more than both errors, and history is forgotten.

Until a first round trip, arrival stands in: nothing that the peer sent can be newer than its clock now.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from metaros.clock import Clock

__all__ = ["Beat", "ClockOffset"]

EXCHANGES = 16
REMEMBERED_BEATS = 16
FORGET_AFTER_S = 300.0  # quartz drifts by about 20 us/s apart: 6 ms in five minutes


@dataclass(frozen=True, slots=True)
class Beat:
    """The three fields of a Heartbeat frame, in nanoseconds."""

    sent_ns: int
    echo_ns: int
    held_ns: int


@dataclass(frozen=True, slots=True)
class _Exchange:
    """One round trip: peer's wall minus our monotonic time, both in ns."""

    at_s: float
    round_trip_ns: int
    difference_ns: int


class ClockOffset:
    """One side's half of the heartbeat exchange and the estimate that it yields."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._sent: dict[int, int] = {}  # our wall time in a beat -> our monotonic ns then
        self._last_sent_ns = -1_000_000
        self._received: tuple[int, int] | None = None  # peer's sent_ns, our monotonic ns at arrival
        self._exchanges: deque[_Exchange] = deque(maxlen=EXCHANGES)
        self._one_way_ns: int | None = None

    def beat(self) -> Beat:
        """The heartbeat to send now."""
        now_ns = self._monotonic_ns()
        sent_ns = self._clock.wall_ns()
        if 0 <= self._last_sent_ns - sent_ns < 1_000_000:  # two beats of one instant must have two names
            sent_ns = self._last_sent_ns + 1
        self._last_sent_ns = sent_ns
        self._sent[sent_ns] = now_ns
        while len(self._sent) > REMEMBERED_BEATS:
            del self._sent[next(iter(self._sent))]
        if self._received is None:
            return Beat(sent_ns, 0, 0)
        return Beat(sent_ns, self._received[0], now_ns - self._received[1])

    def received(self, sent_ns: int, echo_ns: int, held_ns: int) -> None:
        """Take in a heartbeat of the peer; one that answers none of ours only marks the time."""
        now_ns = self._monotonic_ns()
        self._received = (sent_ns, now_ns)
        self.saw(sent_ns)
        ours_ns = self._sent.get(echo_ns)
        if ours_ns is None or held_ns < 0:
            return
        round_trip_ns = now_ns - ours_ns - held_ns
        if round_trip_ns < 0:
            return
        exchange = _Exchange(now_ns / 1e9, round_trip_ns, sent_ns + round_trip_ns // 2 - now_ns)
        best = self._best()
        if best is not None:
            error_ns = (best.round_trip_ns + round_trip_ns) // 2 + round((exchange.at_s - best.at_s) * 1e5)
            if abs(exchange.difference_ns - best.difference_ns) > error_ns + 1_000_000:
                self._exchanges.clear()
                self._one_way_ns = sent_ns - now_ns
        self._exchanges.append(exchange)

    def saw(self, sent_ns: int) -> None:
        """Note a stamp the peer made just before it sent: a bound that serves until the first round trip."""
        difference_ns = sent_ns - self._monotonic_ns()
        if self._one_way_ns is None or difference_ns > self._one_way_ns:
            self._one_way_ns = difference_ns

    @property
    def round_trip_s(self) -> float | None:
        """The least round trip of late, None before the first."""
        best = self._best()
        return None if best is None else best.round_trip_ns / 1e9

    @property
    def last_round_trip_s(self) -> float | None:
        """The newest round trip, None before the first."""
        return self._exchanges[-1].round_trip_ns / 1e9 if self._exchanges else None

    def peer_now_ns(self) -> int | None:
        """The peer's wall clock now, None when nothing was ever received."""
        best = self._best()
        difference_ns = self._one_way_ns if best is None else best.difference_ns
        return None if difference_ns is None else self._monotonic_ns() + difference_ns

    def offset_ns(self) -> int | None:
        """The peer's wall clock minus ours, None when nothing was ever received."""
        peer_ns = self.peer_now_ns()
        return None if peer_ns is None else peer_ns - self._clock.wall_ns()

    def age_s(self, peer_stamp_ns: int) -> float | None:
        """How long ago by the peer's clock that stamp was made; negative when it is ahead."""
        peer_ns = self.peer_now_ns()
        return None if peer_ns is None else (peer_ns - peer_stamp_ns) / 1e9

    def _best(self) -> _Exchange | None:
        oldest_s = self._monotonic_ns() / 1e9 - FORGET_AFTER_S
        fresh = [exchange for exchange in self._exchanges if exchange.at_s >= oldest_s]
        return min(fresh, key=lambda exchange: exchange.round_trip_ns, default=None)

    def _monotonic_ns(self) -> int:
        return round(self._clock.monotonic_s() * 1e9)
