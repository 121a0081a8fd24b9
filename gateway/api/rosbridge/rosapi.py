"""rosapi: the services that rosbridge itself answers, about the graph, types, parameters and the time.

Names are taken with and without a leading slash: roslib 2.1 writes `rosapi/topics`, others `/rosapi/topics`.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from typing import Any

import orjson

from gateway.api.robot_access import RobotAccess
from gateway.api.rosbridge.client_graph import ClientGraph
from gateway.api.rosbridge.dialect import fault_of, types_of
from gateway.api.rosbridge.parameters import Parameters
from gateway.api.rosbridge.typedefs import typedefs
from gateway.errors import InvalidRequestError, RobotError
from gateway.fleet.ros.errors import UnknownServiceError
from gateway.fleet.ros.types import full_type_name
from metaros.errors import UnknownTypeError
from metaros.idl import default_catalogue

__all__ = ["DISTRO", "SERVICES", "Rosapi"]

DISTRO = "jazzy"  # whose wire robots speak
PREFIX = "rosapi/"
Arguments = Mapping[str, Any]
Look = Callable[["Rosapi", Arguments], dict[str, Any]]
Ask = Callable[["Rosapi", Arguments], Awaitable[dict[str, Any]]]


class Rosapi:
    """For one client."""

    def __init__(self, access: RobotAccess) -> None:
        self.access = access
        self.client_graph = ClientGraph(access)
        self.parameters = Parameters(access, self.client_graph)

    @staticmethod
    def serves(service: str) -> bool:
        """Whether a service is one of rosapi's."""
        return service.lstrip("/").startswith(PREFIX)

    async def answer(self, service: str, args: Any) -> dict[str, Any]:
        """The response of one of its services; UnknownServiceError, InvalidRequestError."""
        name = service.lstrip("/").removeprefix(PREFIX)
        said = args if isinstance(args, dict) else {}
        if isinstance(args, list):
            said = dict(zip(ARGUMENTS.get(name, ()), args, strict=False))
        if name in SERVICES:
            return SERVICES[name](self, said)
        if name in _ASKING:
            return await _ASKING[name](self, said)
        raise UnknownServiceError(f"rosapi has no service {name[:80]!r}; it has {', '.join(sorted(ARGUMENTS))}")


def _text(args: Arguments, name: str) -> str:
    value = args.get(name)
    if not isinstance(value, str) or not value:
        raise InvalidRequestError(f"{name} is a text")
    return value


def _named(pairs: list[tuple[str, str]], name: str) -> str:
    """The type of a name, with or without its leading slash; "" where there is none."""
    return dict(pairs).get(name if name.startswith("/") else f"/{name}", "")


def _of_type(pairs: list[tuple[str, str]], type_name: str, kind: str) -> list[str]:
    full = full_type_name(type_name, kind)
    return [name for name, known in pairs if known == full]


def _topics(api: Rosapi, _args: Arguments) -> dict[str, Any]:
    pairs = api.client_graph.topics()
    return {"topics": [name for name, _ in pairs], "types": [kind for _, kind in pairs]}


def _raw_types(api: Rosapi, _args: Arguments) -> dict[str, Any]:
    """Only of announced topics: of those the definition is known."""
    found = api.access.topics()
    return {
        "topics": [item.shown for item in found],
        "types": [item.channel.schema_name for item in found],
        "typedefs_full_text": [item.channel.schema.decode("utf-8", "replace") for item in found],
    }


def _node_details(api: Rosapi, args: Arguments) -> dict[str, Any]:
    publishing, subscribing, services = api.client_graph.of_node(_text(args, "node"))
    return {"subscribing": subscribing, "publishing": publishing, "services": services}


def _details(kind: str, part: str = "") -> Look:
    """The typedefs of a type's part, of the first robot that knows it."""

    def look(api: Rosapi, args: Arguments) -> dict[str, Any]:
        name = full_type_name(_text(args, "type"), kind)
        if name in default_catalogue():
            return {"typedefs": typedefs(f"{name}{part}", default_catalogue())}
        for graph in api.access.graphs():
            for known, catalogue in graph.types.items():
                if known[0] == name:
                    return {"typedefs": typedefs(f"{name}{part}", catalogue)}
        for topic in api.access.topics() if kind == "msg" else ():
            if topic.channel.schema_name == name and not fault_of(topic.channel):
                return {"typedefs": typedefs(name, types_of(topic.channel))}
        raise UnknownTypeError(f"no interface {name!r} in the catalogue, and no robot of yours told it")

    return look


def _time(api: Rosapi, _args: Arguments) -> dict[str, Any]:
    sec, nanosec = divmod(api.access.services.clock.wall_ns(), 1_000_000_000)
    return {"time": {"sec": sec, "nanosec": nanosec, "secs": sec, "nsecs": nanosec}}


async def _param_names(api: Rosapi, _args: Arguments) -> dict[str, Any]:
    return {"names": await api.parameters.names()}


async def _get_param(api: Rosapi, args: Arguments) -> dict[str, Any]:
    name = _text(args, "name")
    default = args.get("default_value", args.get("default", ""))
    try:
        known, value = await api.parameters.get(name)
    except RobotError as error:
        known, value, reason = False, None, str(error)
    else:
        reason = "" if known else f"there is no parameter {name}"
    if known:
        return {"value": orjson.dumps(value).decode(), "successful": True, "reason": ""}
    if isinstance(default, str) and default:
        return {"value": default, "successful": True, "reason": ""}
    return {"value": "null", "successful": False, "reason": reason}


async def _set_param(api: Rosapi, args: Arguments) -> dict[str, Any]:
    successful, reason = await api.parameters.set(_text(args, "name"), _text(args, "value"))
    return {"successful": successful, "reason": reason}


async def _has_param(api: Rosapi, args: Arguments) -> dict[str, Any]:
    try:
        known, _ = await api.parameters.get(_text(args, "name"))
    except RobotError as error:
        return {"exists": False, "successful": False, "reason": str(error)}
    return {"exists": known, "successful": True, "reason": ""}


async def _delete_param(api: Rosapi, args: Arguments) -> dict[str, Any]:
    successful, reason = await api.parameters.set(_text(args, "name"), "")
    return {"successful": successful, "reason": reason}


SERVICES: dict[str, Look] = {
    "topics": _topics,
    "topics_for_type": lambda api, args: {"topics": _of_type(api.client_graph.topics(), _text(args, "type"), "msg")},
    "topics_and_raw_types": _raw_types,
    "topic_type": lambda api, args: {"type": _named(api.client_graph.topics(), _text(args, "topic"))},
    "services": lambda api, args: {"services": [name for name, _ in api.client_graph.services()]},
    "services_for_type": lambda api, args: {
        "services": _of_type(api.client_graph.services(), _text(args, "type"), "srv")
    },
    "service_type": lambda api, args: {"type": _named(api.client_graph.services(), _text(args, "service"))},
    "service_providers": lambda api, args: {"providers": api.client_graph.providers(_text(args, "service"))},
    "service_node": lambda api, args: {"node": next(iter(api.client_graph.providers(_text(args, "service"))), "")},
    "service_request_details": _details("srv", "_Request"),
    "service_response_details": _details("srv", "_Response"),
    "action_servers": lambda api, args: {"action_servers": [name for name, _ in api.client_graph.actions()]},
    "action_type": lambda api, args: {"type": _named(api.client_graph.actions(), _text(args, "action"))},
    "action_goal_details": _details("action", "_Goal"),
    "action_result_details": _details("action", "_Result"),
    "action_feedback_details": _details("action", "_Feedback"),
    "message_details": _details("msg"),
    "nodes": lambda api, args: {"nodes": api.client_graph.nodes()},
    "node_details": _node_details,
    "publishers": lambda api, args: {"publishers": api.client_graph.publishers(_text(args, "topic"))},
    "subscribers": lambda api, args: {"subscribers": api.client_graph.subscribers(_text(args, "topic"))},
    "get_time": _time,
    "get_ros_version": lambda api, args: {"version": 2, "distro": DISTRO},
}
_ASKING: dict[str, Ask] = {
    "get_param_names": _param_names,
    "get_param": _get_param,
    "set_param": _set_param,
    "has_param": _has_param,
    "delete_param": _delete_param,
}
ARGUMENTS: dict[str, tuple[str, ...]] = {  # in the order of the request's fields, for who sends a list
    **dict.fromkeys([*SERVICES, *_ASKING], ()),
    **dict.fromkeys(("topics_for_type", "services_for_type", "message_details"), ("type",)),
    **dict.fromkeys(("topic_type", "publishers", "subscribers"), ("topic",)),
    **dict.fromkeys(("service_type", "service_providers", "service_node"), ("service",)),
    **dict.fromkeys(("has_param", "delete_param"), ("name",)),
    "node_details": ("node",),
    "get_param": ("name", "default_value"),
    "set_param": ("name", "value"),
    "action_type": ("action",),
}
