"""The last seconds of everything, in memory: what is written down only when somebody asks for it. Pure.

Bounded in time and in bytes. Of latched topics the last samples stay although they are older: without the map that was
sent once, the last minute is hard to read.
"""

from __future__ import annotations

from collections import deque
from typing import Final, NamedTuple

from metaros.record.ledger import Publisher
from metaros.record.sample_queue import Arrival

__all__ = ["Ring"]

_LATCHED: Final = 100  # samples a publisher
_OVERHEAD_BYTES: Final = 256


class _Kept(NamedTuple):
    arrival: Arrival
    payload: bytes


class Ring:
    """At most `window_s` and `limit_bytes`; `evicted_early` counts what the bytes pushed out before its time."""

    def __init__(self, *, window_s: float, limit_bytes: int) -> None:
        self.evicted_early = 0
        self.size_bytes = 0
        self._window_ns = round(window_s * 1e9)
        self._limit_bytes = limit_bytes
        self._kept: deque[_Kept] = deque()
        self._latched: dict[Publisher, deque[_Kept]] = {}

    def __len__(self) -> int:
        return len(self._kept) + sum(map(len, self._latched.values()))

    def add(self, arrival: Arrival, payload: bytes) -> None:
        """Keep one more, forget what is too old or too much."""
        self._kept.append(_Kept(arrival._replace(payload=None), payload))
        self.size_bytes += len(payload) + _OVERHEAD_BYTES
        oldest_ns = arrival.log_ns - self._window_ns
        while self._kept and self._kept[0].arrival.log_ns < oldest_ns:
            self._retire(self._kept.popleft())
        while self.size_bytes > self._limit_bytes and len(self._kept) > 1:
            self.evicted_early += 1
            self._retire(self._kept.popleft())
        while self.size_bytes > self._limit_bytes and self._latched:
            self._forget_latched()

    def items(self) -> list[tuple[Arrival, bytes]]:
        """What is there, in order of arrival."""
        everything = [kept for latched in self._latched.values() for kept in latched]
        everything += self._kept
        return sorted(everything, key=lambda kept: kept[0].log_ns)

    def span_s(self) -> float:
        """From the oldest to the newest sample, latched ones left out."""
        return (self._kept[-1].arrival.log_ns - self._kept[0].arrival.log_ns) / 1e9 if self._kept else 0.0

    def _retire(self, kept: _Kept) -> None:
        """Out of the window: gone, unless it is latched."""
        self.size_bytes -= len(kept.payload) + _OVERHEAD_BYTES
        depth = min(kept.arrival.route.latched, _LATCHED)
        if not depth:
            return
        latched = self._latched.setdefault(kept.arrival.publisher, deque())
        latched.append(kept)
        self.size_bytes += len(kept.payload) + _OVERHEAD_BYTES
        while len(latched) > depth:
            self.size_bytes -= len(latched.popleft().payload) + _OVERHEAD_BYTES

    def _forget_latched(self) -> None:
        publisher = next(iter(self._latched))
        latched = self._latched[publisher]
        self.size_bytes -= len(latched.popleft().payload) + _OVERHEAD_BYTES
        if not latched:
            del self._latched[publisher]
