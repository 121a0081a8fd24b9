"""Selects the next gateway, and the order of transports to try. Pure but for the clock."""

from __future__ import annotations

from collections.abc import Sequence

from edge_agent.config.gateway_address import GatewayAddress, TransportName
from metaros.clock import Clock

__all__ = ["GatewaySelector"]

FIRST_AGAIN_S = 600.0  # a second-choice transport that worked is preferred for so long


class GatewaySelector:
    """The list of gateways, each with what is known of it.

    A gateway that worked is kept; one that did not makes place for the next of the list, round and round.
    """

    def __init__(self, gateways: Sequence[GatewayAddress], clock: Clock) -> None:
        self._gateways = list(gateways)
        self._clock = clock
        self._index = 0
        self._second_until_s: dict[GatewayAddress, float] = {}
        self._hold_until_s: dict[GatewayAddress, float] = {}

    @property
    def gateway(self) -> GatewayAddress:
        """The one to try."""
        return self._gateways[self._index]

    def transports(self) -> tuple[TransportName, ...]:
        """How to try it, one after the other."""
        order = self.gateway.transports
        return order[::-1] if self._clock.monotonic_s() < self._second_until_s.get(self.gateway, 0.0) else order

    def worked(self, transport: TransportName) -> None:
        """A session came up by it; called after what stands before it in `transports` has failed."""
        if transport == self.gateway.transports[0]:
            self._second_until_s.pop(self.gateway, None)
        elif transport != self.transports()[0]:
            self._second_until_s[self.gateway] = self._clock.monotonic_s() + FIRST_AGAIN_S

    def failed(self) -> None:
        """No session came up: the next gateway's turn."""
        self._index = (self._index + 1) % len(self._gateways)

    def refused(self, reason: str, retry_after_s: float) -> None:
        """It said goodbye; where another gateway may do better, it is that one's turn."""
        until_s = self._clock.monotonic_s() + retry_after_s
        if reason == "forked":  # the outbox has new labels by now, and is welcome at once
            return
        if reason == "fenced":  # another process is this robot, wherever we go
            self._hold_until_s.update(dict.fromkeys(self._gateways, until_s))
            return
        self._hold_until_s[self.gateway] = until_s
        self.failed()

    def hold_s(self) -> float:
        """Seconds for which the gateway has asked us to stay away."""
        return max(0.0, self._hold_until_s.get(self.gateway, 0.0) - self._clock.monotonic_s())
