"""The names under which a client sees robots' topics, services and actions. Pure.

A client that asked for one robot sees its ROS names as they are, so that what was written for one robot works
unchanged. A client of the whole fleet sees each name behind its robot's id, `/r1/odom`; a name that already begins
with the id, as in a robot whose namespace is its id, stays as it is.
"""

from __future__ import annotations

from collections.abc import Callable

__all__ = ["ClientNames"]


class ClientNames:
    """Names of one robot (`robot` set), or of all that `sees` lets through."""

    __slots__ = ("robot", "sees")

    def __init__(self, robot: str | None = None, *, sees: Callable[[str], bool] = lambda _: True) -> None:
        self.robot = robot
        self.sees = sees

    def covers(self, robot: str) -> bool:
        """Whether the client sees anything of that robot."""
        return self.sees(robot) and self.robot in (None, robot)

    def shown(self, robot: str, name: str) -> str:
        """What the client calls a robot's full ROS name."""
        if self.robot is not None or name == f"/{robot}" or name.startswith(f"/{robot}/"):
            return name
        return f"/{robot}{name}"

    def candidates(self, shown: str) -> list[tuple[str, str]]:
        """(robot, full ROS name) that a client's name may mean, the likeliest first; relative names count as full.

        Of the fleet's names `/r1/odom` may be r1's `/r1/odom` or its `/odom`: the caller takes what that robot has, or
        else the first.
        """
        name = shown if shown.startswith("/") else f"/{shown}"
        if self.robot is not None:
            return [(self.robot, name)] if self.sees(self.robot) else []
        robot, slash, rest = name[1:].partition("/")
        if not slash or not robot or not rest or not self.sees(robot):
            return []
        return [(robot, name), (robot, f"/{rest}")]
