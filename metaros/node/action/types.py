"""The wire side of an action: its five endpoints, their types and codecs, and ids and stamps to and fro."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, TypedDict

from metaros.cdr import Codec, codec
from metaros.errors import UsageError
from metaros.idl import Action, message_class, remember_class

__all__ = ["ENDPOINTS", "ActionTypes", "id_of", "ns_of"]

# What comes after the action's name; the order in which ROS 2 creates them.
ENDPOINTS: Final = {
    "send_goal": "/_action/send_goal",
    "cancel_goal": "/_action/cancel_goal",
    "get_result": "/_action/get_result",
    "feedback": "/_action/feedback",
    "status": "/_action/status",
}


class Coders(TypedDict):
    """The codecs of a service, as servers and clients take them."""

    request: Codec
    response: Codec


@dataclass(frozen=True)
class ActionTypes:
    """Every class that an action brings along. The first five are those of the endpoints."""

    action: type[Any]

    def __post_init__(self) -> None:
        if not (isinstance(self.action, type) and issubclass(self.action, Action)):
            raise UsageError(f"{self.action!r} is no action class, such as example_interfaces.action.Fibonacci")
        remember_class(self.action, "_SendGoal", "_GetResult", "_FeedbackMessage")

    def _own(self, part: str) -> type[Any]:
        return message_class(f"{self.action.__metaros_name__}_{part}", self.action.__metaros_catalogue__)

    def _shared(self, name: str) -> type[Any]:
        """What all actions have in common, of the same shape as this action's own classes."""
        return message_class(name, self.action.__metaros_catalogue__)

    @cached_property
    def send_goal(self) -> type[Any]:
        """The service that brings goals."""
        return self._own("SendGoal")

    @cached_property
    def cancel_goal(self) -> type[Any]:
        """The service that cancels them."""
        return self._shared("action_msgs/srv/CancelGoal")

    @cached_property
    def get_result(self) -> type[Any]:
        """The service that waits for results."""
        return self._own("GetResult")

    @cached_property
    def feedback(self) -> type[Any]:
        """The message of the feedback topic."""
        return self._own("FeedbackMessage")

    @cached_property
    def status(self) -> type[Any]:
        """The message of the status topic."""
        return self._shared("action_msgs/msg/GoalStatusArray")

    @cached_property
    def goal_status(self) -> type[Any]:
        """One entry of it."""
        return self._shared("action_msgs/msg/GoalStatus")

    @cached_property
    def goal_info(self) -> type[Any]:
        """A goal's id and stamp."""
        return self._shared("action_msgs/msg/GoalInfo")

    @cached_property
    def uuid(self) -> type[Any]:
        """A goal's id."""
        return self._shared("unique_identifier_msgs/msg/UUID")

    @cached_property
    def time(self) -> type[Any]:
        """A stamp."""
        return self._shared("builtin_interfaces/msg/Time")

    def stamp(self, ns: int) -> Any:
        """Nanoseconds since the epoch as a Time."""
        seconds, nanoseconds = divmod(ns, 1_000_000_000)
        return self.time(sec=seconds, nanosec=nanoseconds)

    def goal_id(self, goal_id: bytes) -> Any:
        """16 bytes as a UUID."""
        return self.uuid(uuid=goal_id)

    def info(self, goal_id: bytes, stamp_ns: int) -> Any:
        """A GoalInfo."""
        return self.goal_info(goal_id=self.goal_id(goal_id), stamp=self.stamp(stamp_ns))

    @staticmethod
    def coders(service: type[Any]) -> Coders:
        """The codecs of a service."""
        return {"request": codec(service.Request), "response": codec(service.Response)}


def id_of(uuid: Any) -> bytes:
    """The 16 bytes of a UUID message."""
    return bytes(uuid.uuid.tobytes())


def ns_of(stamp: Any) -> int:
    """Nanoseconds since the epoch of a Time message."""
    return int(stamp.sec) * 1_000_000_000 + int(stamp.nanosec)
