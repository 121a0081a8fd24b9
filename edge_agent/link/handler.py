"""Handlers of control-lane frames: each receives some kinds of frames from the gateway, and may send frames.

They exist beside commands and teleop, and the session knows nothing of what they say.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Protocol

from edge_agent.link.frames import ControlFrame
from metaros._proto import link_pb2

__all__ = ["CONTROL_FRAMES", "ControlHandler", "SendFrame"]

CONTROL_FRAMES: Final = frozenset({"twin", "twin_confirmed", "node_leases", "result_stored", "offers", "offer_answer"})
SendFrame = Callable[[link_pb2.AgentFrame], None]


class ControlHandler(Protocol):
    """A part of the agent that handles control frames. It runs on the event loop; no method may raise or block."""

    frames: frozenset[str]

    def link_up(self, send: SendFrame, welcome: link_pb2.Welcome) -> None:
        """All lanes are open; `send` puts a frame on the control lane for as long as this link lives."""

    def take(self, received: ControlFrame) -> None:
        """Handle a frame of one of the kinds in `frames`."""

    def link_down(self) -> None:
        """There is no link any more; also called where there was none yet."""
