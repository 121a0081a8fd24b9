"""What the link needs of whatever authenticates robots: may this one connect, may it stay connected?"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Protocol

from gateway.domain.identity import Admitted, Peer
from metaros._proto import link_pb2

__all__ = ["Ask", "NoAuthentication", "RobotAuthenticator"]

Ask = Callable[[link_pb2.Challenge], Awaitable[bytes]]


class RobotAuthenticator(Protocol):
    """Decides by certificates and proofs; the link only carries them."""

    async def admit(self, hello: link_pb2.Hello, peer: Peer, ask: Ask, /) -> Admitted:
        """Who opens this lane; where TLS has not proven it, `ask` sends a challenge and gives the signature that came
        back. UnprovenError when it may not.
        """

    def recheck(self, admitted: Admitted, /) -> None:
        """UnprovenError when who was admitted may not stay."""

    def cloned(self, robot: str, /) -> None:
        """Two processes speak as this robot in turn."""


class NoAuthentication:
    """Believes every robot id: where no robot is enrolled."""

    async def admit(self, hello: link_pb2.Hello, peer: Peer, ask: Ask, /) -> Admitted:
        """Without a look."""
        return Admitted(hello.robot_id)

    def recheck(self, admitted: Admitted, /) -> None:
        """Always."""

    def cloned(self, robot: str, /) -> None:
        """Nothing to say: there is no identity to copy."""
