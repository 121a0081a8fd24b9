"""The raw peer's parameters and states: the services that `ros2 param` and `ros2 lifecycle` use, served and asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from tests.ros2.participant import SPEED, Fields

__all__ = ["RawParameters", "RawStates"]

DEEP = "::,1000:,:,:,,"
STAMP = {"sec": 1, "nanosec": 0}
KINDS = {bool: (1, "bool_value"), int: (2, "integer_value"), float: (3, "double_value"), str: (4, "string_value")}
EMPTY: Fields = {
    "type": 0,
    "bool_value": False,
    "integer_value": 0,
    "double_value": 0.0,
    "string_value": "",
    **{f"{kind}_array_value": [] for kind in ("byte", "bool", "integer", "double", "string")},
}
# From a state, by a transition: id of the transition, the state on the way, the state that follows.
STATES = {0: "unknown", 1: "unconfigured", 2: "inactive", 3: "active", 4: "finalized", 10: "configuring"}
STATES |= {11: "cleaningup", 12: "shuttingdown", 13: "activating", 14: "deactivating", 15: "errorprocessing"}
MOVES = {
    (1, "configure"): (1, 10, 2),
    (2, "cleanup"): (2, 11, 1),
    (2, "activate"): (3, 13, 3),
    (3, "deactivate"): (4, 14, 2),
}
LABELS = {number: label for (_, label), (number, _, _) in MOVES.items()}


class RawNodeLike(Protocol):
    """What is needed of the node."""

    def serve(self, name: str, type_name: str, answer: Callable[[Fields], Fields | None]) -> None: ...

    def call(self, name: str, type_name: str, request: Fields) -> Fields: ...

    def publisher(self, topic: str, type_name: str, qos: str) -> Callable[[Fields], None]: ...


def packed(value: object) -> Fields:
    """A ParameterValue."""
    number, field = KINDS[type(value)]
    return {**EMPTY, "type": number, field: value}


def unpacked(value: Fields) -> Any:
    """What a ParameterValue holds."""
    fields = dict(KINDS.values())
    return value[fields[value["type"]]] if value["type"] in fields else None


class RawParameters:
    """One parameter, `speed`, between 0 and 1; others' are read and written."""

    def __init__(self, node: RawNodeLike, prefix: str) -> None:
        self._node, self._prefix, self._speed = node, prefix, SPEED
        self._events = node.publisher("/parameter_events", "rcl_interfaces/msg/ParameterEvent", DEEP)
        node.serve(f"{prefix}/list_parameters", "rcl_interfaces/srv/ListParameters", self._list)
        node.serve(f"{prefix}/get_parameters", "rcl_interfaces/srv/GetParameters", self._get)
        node.serve(f"{prefix}/set_parameters", "rcl_interfaces/srv/SetParameters", self._set)
        node.serve(f"{prefix}/describe_parameters", "rcl_interfaces/srv/DescribeParameters", self._describe)
        node.serve(f"{prefix}/get_parameter_types", "rcl_interfaces/srv/GetParameterTypes", self._types)
        node.serve(f"{prefix}/set_parameters_atomically", "rcl_interfaces/srv/SetParametersAtomically", self._set_all)

    def _list(self, request: Fields) -> Fields:
        return {"result": {"names": ["speed"], "prefixes": []}}

    def _get(self, request: Fields) -> Fields:
        return {"values": [packed(self._speed) if name == "speed" else EMPTY for name in request["names"]]}

    def _set(self, request: Fields) -> Fields:
        results = []
        for one in request["parameters"]:
            value = unpacked(one["value"])
            fits = one["name"] == "speed" and isinstance(value, float) and 0 <= value <= 1
            results.append({"successful": fits, "reason": "" if fits else "not within 0..1"})
            if fits:
                self._speed = value
                event = {"stamp": STAMP, "node": self._prefix, "new_parameters": [], "deleted_parameters": []}
                self._events({**event, "changed_parameters": [one]})
        return {"results": results}

    def _set_all(self, request: Fields) -> Fields:
        (result,) = self._set(request)["results"]
        return {"result": result}

    def _types(self, request: Fields) -> Fields:
        return {"types": [3 if name == "speed" else 0 for name in request["names"]]}

    def _describe(self, request: Fields) -> Fields:
        rules = {"description": "m/s", "additional_constraints": "", "read_only": False, "dynamic_typing": False}
        bounds = [{"from_value": 0.0, "to_value": 1.0, "step": 0.0}]
        one = {"name": "speed", "type": 3, **rules, "floating_point_range": bounds, "integer_range": []}
        return {"descriptors": [one for name in request["names"] if name == "speed"]}

    def read(self, node: str) -> dict[str, Any]:
        """All of a node's."""
        asked = {"prefixes": [], "depth": 0}
        listed = self._node.call(f"{node}/list_parameters", "rcl_interfaces/srv/ListParameters", asked)
        names = listed["result"]["names"]
        answer = self._node.call(f"{node}/get_parameters", "rcl_interfaces/srv/GetParameters", {"names": names})
        return {name: unpacked(value) for name, value in zip(names, answer["values"], strict=True)}

    def write(self, node: str, name: str, value: object) -> str | None:
        """None, or the reason of the refusal."""
        request = {"parameters": [{"name": name, "value": packed(value)}]}
        answer = self._node.call(f"{node}/set_parameters", "rcl_interfaces/srv/SetParameters", request)
        (result,) = answer["results"]
        return None if result["successful"] else result["reason"]


class RawStates:
    """A lifecycle node's services and its topic."""

    def __init__(self, node: RawNodeLike, prefix: str) -> None:
        self._state = 1
        self._events = node.publisher(
            f"{prefix}/transition_event", "lifecycle_msgs/msg/TransitionEvent", "::,10:,:,:,,"
        )
        node.serve(f"{prefix}/get_state", "lifecycle_msgs/srv/GetState", self._get)
        node.serve(f"{prefix}/change_state", "lifecycle_msgs/srv/ChangeState", self._change)

    def _get(self, _: Fields) -> Fields:
        return {"current_state": self._named(self._state)}

    def _change(self, request: Fields) -> Fields:
        label = request["transition"]["label"] or LABELS.get(request["transition"]["id"], "")
        move = MOVES.get((self._state, label))
        if move is None:
            return {"success": False}
        number, way, goal = move
        self._tell({"id": number, "label": label}, self._state, way)
        self._tell({"id": 10, "label": "transition_success"}, way, goal)
        self._state = goal
        return {"success": True}

    def _tell(self, transition: Fields, start: int, goal: int) -> None:
        states = {"start_state": self._named(start), "goal_state": self._named(goal)}
        self._events({"timestamp": 1, "transition": transition, **states})

    @staticmethod
    def _named(number: int) -> Fields:
        return {"id": number, "label": STATES[number]}
