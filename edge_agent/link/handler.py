"""Parts of the agent that talk to the gateway over the control lane: each takes some kinds of frames, and may tell.

They exist beside commands and teleop, and the session knows nothing of what they say.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from metaros._proto import link_pb2

__all__ = ["DESK_FRAMES", "LinkDesk", "Tell", "Told"]

DESK_FRAMES: Final = frozenset({"twin", "twin_confirmed", "node_leases", "result_stored", "offers", "offer_answer"})
Tell = Callable[[link_pb2.AgentFrame], None]


@dataclass(frozen=True, slots=True)
class Told:
    """A frame for a desk, and when it came."""

    frame: link_pb2.GatewayFrame
    arrived_s: float


class LinkDesk(Protocol):
    """One such part. All of it runs on the event loop, and nothing of it may raise or wait."""

    frames: frozenset[str]

    def link_up(self, tell: Tell, welcome: link_pb2.Welcome) -> None:
        """All lanes are open; `tell` puts a frame on the control lane for as long as this link lives."""

    def take(self, told: Told) -> None:
        """One of its frames has come."""

    def link_down(self) -> None:
        """There is no link any more; also called where there was none yet."""
