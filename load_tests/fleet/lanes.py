"""One lane as the simulator needs it: bytes of frames in and out by callbacks, without a task of its own."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Protocol

__all__ = ["Lane", "LaneCallbacks", "OpenLane", "Traffic"]


@dataclass(slots=True)
class Traffic:
    """What crossed the sockets of all lanes, HTTP/2 or WebSocket framing included, TCP and IP not."""

    sent_bytes: int = 0
    received_bytes: int = 0
    sent_frames: int = 0
    received_frames: int = 0


@dataclass(frozen=True, slots=True)
class LaneCallbacks:
    """What a lane calls: for a frame that came, the end of the connection and why, room for more."""

    frame: Callable[[bytes], None]
    over: Callable[[str], None]
    room: Callable[[], None]


class Lane(Protocol):
    """One connection. `full` asks the writer to wait for `LaneCallbacks.room`; nothing is called after `close`."""

    @property
    def full(self) -> bool:
        """Whether what was written still waits here."""

    def write(self, frame: bytes) -> None:
        """Send a serialised AgentFrame."""

    def ping(self) -> None:
        """Ask the other end's system whether it is there, as the agent's keep-alive does."""

    def close(self) -> None:
        """Cut the connection."""


OpenLane = Callable[[str, int, LaneCallbacks, Traffic], Awaitable[Lane]]  # host, port; raises OSError
