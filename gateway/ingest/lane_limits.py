"""Limits on robots' connection attempts: how many lanes may be opening at a time, and how often. Pure.

A lane that has not said who it is costs little, but not nothing. So their number is bounded, and by address too; an
address, and a robot that was let in, open lanes at a rate. This machine's own address is counted with nobody: there
are its simulated robots, and proxies.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from gateway.domain.buckets import TokenBuckets
from gateway.domain.identity import Peer
from gateway.errors import LinkBusyError
from metaros.clock import Clock
from metaros.limits import Limits

__all__ = ["LaneLimits"]

BURST_S = 10.0


class LaneLimits:
    """The lanes of one gateway that are being opened, over gRPC and WebSocket."""

    def __init__(self, *, clock: Clock, limits: Limits) -> None:
        self._clock = clock
        self._limits = limits
        self._addresses = _buckets(limits.links_address_per_s)
        self._robots = _buckets(limits.links_robot_per_s)
        self._opening: dict[str, int] = {}
        self.opening_lanes = 0

    @contextmanager
    def opening(self, peer: Peer) -> Iterator[None]:
        """A lane is being opened; LinkBusyError when there are too many, or came too often."""
        address = "" if peer.local else peer.address
        theirs = self._opening.get(address, 0)
        if self.opening_lanes >= self._limits.links_waiting:
            raise LinkBusyError("too many lanes are being opened")
        if address:
            if theirs >= self._limits.links_waiting_address:
                raise LinkBusyError("too many lanes of this address are being opened")
            _take(self._addresses, address, self._clock.monotonic_s(), "this address")
        self.opening_lanes += 1
        self._opening[address] = theirs + 1
        try:
            yield
        finally:
            self.opening_lanes -= 1
            self._opening[address] -= 1
            if not self._opening[address]:
                del self._opening[address]

    def admitted(self, robot_id: str) -> None:
        """A robot's lane is let in; LinkBusyError when it opened too many lately."""
        _take(self._robots, robot_id, self._clock.monotonic_s(), f"robot {robot_id[:64]}")


def _buckets(per_s: float) -> TokenBuckets:
    return TokenBuckets(per_s=per_s, burst=per_s * BURST_S)


def _take(buckets: TokenBuckets, key: str, now_s: float, who: str) -> None:
    if buckets.take(key, now_s):
        raise LinkBusyError(f"{who} opens lanes too often")
