"""The view of a robot that this feature needs; the wiring provides the registry's records."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from gateway.domain.channel import Channel
from gateway.domain.robot import Robot
from gateway.errors import RobotOfflineError
from metaros._proto import link_pb2

__all__ = ["FindRobot", "RobotView", "SendFrame", "require_online"]


class RobotView(Protocol):
    """A robot, its link's state and what it announced."""

    robot: Robot
    online: bool  # at this gateway, or at another one of the same store
    here: bool  # at this very gateway
    rtt_s: float | None

    def channel_of(self, topic: str) -> Channel | None:
        """The announced channel of a topic."""


SendFrame = Callable[[str, link_pb2.GatewayFrame], None]  # to a robot's control lane; raises RobotOfflineError
FindRobot = Callable[[str], RobotView]  # raises UnknownRobotError


def require_online(view: RobotView) -> RobotView:
    """The view itself, or RobotOfflineError."""
    if not view.online:
        raise RobotOfflineError(f"robot {view.robot.id} has no link now")
    return view
