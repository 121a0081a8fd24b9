"""Which robots a subscription may match: what its pattern says, and only what its viewer sees at all. Pure."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from gateway.domain.channel import Channel
from metaros.idl.globs import Glob

__all__ = ["RobotPattern", "VisibleRobots", "matching"]


class RobotPattern(Protocol):
    """A pattern over robot ids."""

    def matches(self, topic: str, /) -> bool:
        """Whether the robot is meant."""


class VisibleRobots:
    """A pattern that never matches a robot out of the viewer's scope, however wide it is."""

    __slots__ = ("_pattern", "_sees")

    def __init__(self, pattern: Glob, sees: Callable[[str], bool]) -> None:
        self._pattern = pattern
        self._sees = sees

    def matches(self, robot: str, /) -> bool:
        """Whether the pattern means the robot and the viewer sees it."""
        return self._pattern.matches(robot) and self._sees(robot)


def matching(robots: RobotPattern, topics: Glob) -> Callable[[Channel], bool]:
    """Whether a channel is one of those topics of those robots."""
    return lambda channel: robots.matches(channel.robot) and topics.matches(channel.topic)
