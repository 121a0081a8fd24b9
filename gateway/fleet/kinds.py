"""The kinds of commands that people send: what each asks for, as JSON, and what comes back. One table."""

from __future__ import annotations

import asyncio
import base64
import binascii
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from typing import Any

import orjson

from gateway.errors import InvalidRequestError
from gateway.fleet.manager import FleetManager
from gateway.fleet.ros.typed import LARGE_BYTES
from metaros._proto import link_pb2
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["KINDS", "Kind", "build", "kind_of", "read_result"]

VERBS = ("start", "stop", "restart", "signal", "retry")
MAX_TEXT_CHARS = 1024
Request = Mapping[str, Any]
Build = Callable[[FleetManager, str, Request], Awaitable[link_pb2.Command]]


@dataclass(frozen=True, slots=True)
class Kind:
    """One row: the permission it needs, the fields of its request with their types, the first `needed` of them must
    be there."""

    name: str
    permission: str
    fields: Mapping[str, type | tuple[type, ...]]
    needed: tuple[str, ...]
    build: Build


async def _publish(fleet: FleetManager, robot: str, request: Request) -> link_pb2.Command:
    cdr = request.get("cdr")
    try:
        payload = None if cdr is None else base64.b64decode(cdr, validate=True)
    except (binascii.Error, ValueError) as error:
        raise InvalidRequestError("request.cdr is base64") from error
    return await fleet.publishing(
        robot,
        request["topic"],
        type_name=request.get("type", ""),
        message=request.get("message", {}),
        cdr=payload,
        lease_id=request.get("lease_id", ""),
    )


async def _call(fleet: FleetManager, robot: str, request: Request) -> link_pb2.Command:
    return await fleet.calling(
        robot,
        request["service"],
        type_name=request["type"],
        request=request.get("request", {}),
        lease_id=request.get("lease_id", ""),
    )


async def _node_verb(fleet: FleetManager, robot: str, request: Request) -> link_pb2.Command:
    if request["verb"] not in VERBS:
        raise InvalidRequestError(f"request.verb is one of {', '.join(VERBS)}")
    signal = int(request.get("signal", 0))
    if not 0 <= signal <= 64:
        raise InvalidRequestError("request.signal is a signal's number")
    return link_pb2.Command(node_verb=link_pb2.NodeVerb(node=request["node"], verb=request["verb"], signal=signal))


async def _read_log(fleet: FleetManager, robot: str, request: Request) -> link_pb2.Command:
    size = int(request.get("max_bytes", 64 * 1024))
    if not 1 <= size <= LIMITS.result_bytes:
        raise InvalidRequestError(f"request.max_bytes is 1 to {LIMITS.result_bytes}")
    return link_pb2.Command(
        read_log=link_pb2.ReadLog(
            node=request["node"],
            cursor=request.get("cursor", ""),
            max_bytes=size,
            query=request.get("query", ""),
            backwards=request.get("backwards", False),
        )
    )


async def _set_uplink(fleet: FleetManager, robot: str, request: Request) -> link_pb2.Command:
    bytes_per_s = request["bytes_per_s"] or 0
    if not 0 <= bytes_per_s < 2**63:
        raise InvalidRequestError("request.bytes_per_s is 0 or more; 0 or null is no limit")
    return link_pb2.Command(set_uplink=link_pb2.SetUplink(bytes_per_s=bytes_per_s))


async def _save_recording(fleet: FleetManager, robot: str, request: Request) -> link_pb2.Command:
    """The gateway's own recording manager asks the robot, again and again until it has the file."""
    if not all(isinstance(topic, str) for topic in request.get("topics", ())):
        raise InvalidRequestError("request.topics are patterns of topics")
    return link_pb2.Command()


KINDS: tuple[Kind, ...] = (
    Kind(
        "publish",
        "robots.publish",
        {"topic": str, "type": str, "message": dict, "cdr": str, "lease_id": str},
        ("topic",),
        _publish,
    ),
    Kind(
        "call_service",
        "robots.call",
        {"service": str, "type": str, "request": dict, "lease_id": str},
        ("service", "type"),
        _call,
    ),
    Kind("node_verb", "nodes.control", {"node": str, "verb": str, "signal": int}, ("node", "verb"), _node_verb),
    Kind(
        "read_log",
        "nodes.read",
        {"node": str, "cursor": str, "max_bytes": int, "query": str, "backwards": bool},
        ("node",),
        _read_log,
    ),
    Kind("save_recording", "recordings.save", {"last_s": (int, float), "topics": list}, ("last_s",), _save_recording),
    Kind("set_uplink", "robots.configure", {"bytes_per_s": (int, type(None))}, ("bytes_per_s",), _set_uplink),
)
_BY_NAME = {kind.name: kind for kind in KINDS}


def kind_of(name: str) -> Kind:
    """The row of a kind; InvalidRequestError for one that there is none of."""
    if (found := _BY_NAME.get(name)) is None:
        raise InvalidRequestError(f"kind is one of {', '.join(_BY_NAME)}")
    return found


async def build(fleet: FleetManager, robot: str, kind: Kind, request: Request, *, durable: bool) -> link_pb2.Command:
    """The command as it goes over the link, without id and times.

    Raises:
        InvalidRequestError: the request does not fit, or would move the robot later than now.
        UnknownRobotError, LeaseRequiredError: see FleetManager.
    """
    for name, value in request.items():
        wanted = kind.fields.get(name)
        if wanted is None:
            raise InvalidRequestError(f"request.{name[:64]} is no field of {kind.name}: {', '.join(kind.fields)}")
        if not isinstance(value, wanted) or (isinstance(value, bool) and wanted is not bool):
            raise InvalidRequestError(f"request.{name} has the wrong type")
        if isinstance(value, str) and name != "cdr" and (len(value) > MAX_TEXT_CHARS or "\0" in value):
            raise InvalidRequestError(f"request.{name} is at most {MAX_TEXT_CHARS} characters without NUL")
    for name in kind.needed:
        if name not in request:
            raise InvalidRequestError(f"request.{name} is missing")
    target = request.get("topic") or request.get("service")
    if durable and isinstance(target, str) and fleet.is_actuator(robot, target):
        raise InvalidRequestError(f"{target} is an actuator: what moves the robot is never durable")
    return await kind.build(fleet, robot, request)


async def read_result(fleet: FleetManager, wire: link_pb2.Command, payload: bytes) -> str:
    """What came back, as JSON text; "" where a kind has nothing to tell."""
    action = wire.WhichOneof("action")
    if not payload or action not in ("call_service", "read_log"):
        return ""

    def read() -> bytes:
        return orjson.dumps(fleet.response(wire, payload) if action == "call_service" else orjson.loads(payload))

    try:
        large = len(payload) > LARGE_BYTES
        return (await asyncio.to_thread(read) if large else read()).decode()
    except (MetarosError, ValueError, TypeError):
        return orjson.dumps({"base64": base64.b64encode(payload).decode()}).decode()
