"""What the uplink needs of a transport: lanes that carry frames. gRPC and WebSocket both give it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Protocol

from google.protobuf.message import DecodeError

from edge_agent.config.gateway_address import GatewayAddress
from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.limits import LIMITS

__all__ = ["DEAD_PATH_S", "Connection", "OpenLane", "gateway_frame"]

# When the other end's system confirms nothing for so long, the connection is dead: TCP's own pauses grow longer than
# that, and a new connection is there sooner once the network is back.
DEAD_PATH_S = 3.0


class Connection(Protocol):
    """One open lane. All methods raise LinkError when the connection is gone; `read` also FrameError."""

    async def write(self, frame: bytes) -> None:
        """Write a serialised AgentFrame; waits while the other side takes no more."""

    async def read(self) -> link_pb2.GatewayFrame:
        """The next frame of the gateway."""

    async def close(self) -> None:
        """End it, soon, whatever state it is in; never raises."""


OpenLane = Callable[[GatewayAddress], Awaitable[Connection]]  # connects; its Hello names the lane


def gateway_frame(data: bytes) -> link_pb2.GatewayFrame:
    """Parse what the gateway sent."""
    if len(data) > LIMITS.frame_bytes:
        raise FrameError(f"a frame of {len(data)} bytes is over the limit of {LIMITS.frame_bytes}")
    try:
        return link_pb2.GatewayFrame.FromString(data)
    except DecodeError as error:
        raise FrameError(f"no GatewayFrame: {error}") from error
