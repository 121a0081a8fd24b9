"""The interface of the mesh, which the real one and the tests' in-memory one implement."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Protocol

__all__ = ["Answer", "Mesh", "PeerListener", "Take"]

Take = Callable[[str, bytes], None]  # sender and payload
Answer = Callable[[str, bytes], Awaitable[bytes]]  # likewise; what it returns goes back
PeerListener = Callable[[str, bool], None]  # a gateway came (True) or went


class Mesh(Protocol):
    """The gateways of one store, as one of them sees the others. All on the event loop."""

    @property
    def gateway_id(self) -> str:
        """This gateway's own id."""

    def peers(self) -> frozenset[str]:
        """The other gateways that live now."""

    def send(self, gateway: str, topic: str, payload: bytes) -> bool:
        """Send a message to one gateway: those of one topic arrive in order, or not at all when it goes.

        False: there is no such peer, or so much waits for it already that this was not sent.
        """

    def broadcast(self, topic: str, payload: bytes) -> None:
        """Send a message to every peer."""

    async def request(self, gateway: str, verb: str, payload: bytes, *, timeout_s: float) -> bytes:
        """Have a gateway do something, and get its answer.

        Raises:
            PeerGoneError: it is no peer, or went before it answered.
            PeerTimeoutError: no answer in time; whether it was done is not known.
            PeerRefusedError: it answered with an error, whose code and text this one has.
        """

    def on_message(self, topic: str, take: Take) -> None:
        """Who takes the messages of a topic."""

    def on_request(self, verb: str, answer: Answer) -> None:
        """Who answers a verb."""

    def on_peer(self, listener: PeerListener) -> None:
        """Add a listener for gateways that come or go; listeners run in the order of these calls."""
