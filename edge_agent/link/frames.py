"""What the gateway sent over the link, and when it came."""

from __future__ import annotations

from dataclasses import dataclass

from metaros._proto import link_pb2

__all__ = ["CommandArrived", "ControlFrame", "TeleopArrived"]


@dataclass(frozen=True, slots=True)
class ControlFrame:
    """A frame for a handler of the control lane, and when it came."""

    frame: link_pb2.GatewayFrame
    arrived_s: float


@dataclass(frozen=True, slots=True)
class CommandArrived:
    """A command, when it came (its deadline counts from there), and the gateway's wall clock then, if that is known."""

    command: link_pb2.Command
    arrived_s: float
    peer_ns: int | None = None

    def age_s(self, now_s: float) -> float | None:
        """How long ago it was sent by the gateway's clock; None when it does not say."""
        if self.peer_ns is None or not self.command.sent_ns:
            return None
        return (self.peer_ns - self.command.sent_ns) / 1e9 + now_s - self.arrived_s


@dataclass(frozen=True, slots=True)
class TeleopArrived:
    """A drive command with its age by the gateway's clock."""

    teleop: link_pb2.Teleop
    age_s: float
