"""What a rosbridge client asks, one class an op, checked field by field. Pure."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import orjson

from gateway.errors import InvalidRequestError
from metaros.limits import LIMITS

__all__ = [
    "COMPRESSIONS",
    "LEVELS",
    "OPS",
    "ActionFeedback",
    "ActionResult",
    "Advertise",
    "CallService",
    "CancelGoal",
    "Offer",
    "Publish",
    "Request",
    "SendGoal",
    "ServiceResponse",
    "SetLevel",
    "Shape",
    "Subscribe",
    "Unadvertise",
    "Unoffer",
    "Unsubscribe",
    "read_object",
    "read_request",
]

COMPRESSIONS = ("none", "png", "cbor", "cbor-raw")  # the later wins where one client asks for several
LEVELS = ("none", "error", "warning", "info")
MAX_TIMEOUT_S = 120.0
MAX_QUEUE = 10_000
MAX_MS = 86_400_000
NAME_CHARS = 512


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """Any op; `id` is the client's own, echoed in what answers it."""

    op: str
    id: str | None = None
    chars: int = 0  # of the JSON text that it came in


@dataclass(frozen=True, slots=True, kw_only=True)
class Shape:
    """How a long answer is wanted: pieces of at most so many characters (None: whole), and a compression."""

    fragment_size: int | None = None
    compression: str = "none"


@dataclass(frozen=True, slots=True, kw_only=True)
class Advertise(Request):
    """The client will publish on `topic`."""

    topic: str
    type_name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Unadvertise(Request):
    """It will not any more."""

    topic: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Publish(Request):
    """One message; `lease_id` and `sent_ns` are additions of ours, for actuators."""

    topic: str
    message: Any
    type_name: str = ""
    lease_id: str = ""
    sent_ns: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Subscribe(Request):
    """The client wants a topic's messages: at least `throttle_s` apart, at most `queue_length` of them waiting."""

    topic: str
    type_name: str
    throttle_s: float
    queue_length: int
    shape: Shape


@dataclass(frozen=True, slots=True, kw_only=True)
class Unsubscribe(Request):
    """It does not any more: that subscription, or all of its own to the topic."""

    topic: str


@dataclass(frozen=True, slots=True, kw_only=True)
class CallService(Request):
    """Call a service; `args` is an object, or a list in the order of the fields."""

    service: str
    args: Any
    type_name: str
    timeout_s: float | None
    lease_id: str
    shape: Shape


@dataclass(frozen=True, slots=True, kw_only=True)
class Offer(Request):
    """The client answers a service, or an action, of that name from now on."""

    name: str
    type_name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Unoffer(Request):
    """It does not any more."""

    name: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ServiceResponse(Request):
    """The client's answer to a call that it was sent."""

    values: Any
    result: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SendGoal(Request):
    """Start a goal of an action; `feedback`: the client wants to hear of its progress."""

    action: str
    type_name: str
    args: Any
    feedback: bool
    lease_id: str
    shape: Shape


@dataclass(frozen=True, slots=True, kw_only=True)
class CancelGoal(Request):
    """Stop a goal: `id` is that of the client's SendGoal."""

    action: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionFeedback(Request):
    """Progress of a goal that the client carries out."""

    values: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class ActionResult(Request):
    """Its end."""

    values: Any
    status: int
    result: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class SetLevel(Request):
    """Which statuses the client wants."""

    level: str


def read_object(frame: str | bytes) -> dict[str, Any]:
    """The JSON object in a frame; Python's NaN and Infinity are taken, too, as roslibpy writes them."""
    if len(frame) > LIMITS.rosbridge_message_bytes:
        raise InvalidRequestError(f"a message has at most {LIMITS.rosbridge_message_bytes} bytes")
    try:
        found = orjson.loads(frame)
    except orjson.JSONDecodeError as error:
        found = _lenient(frame, error)
    if not isinstance(found, dict):
        raise InvalidRequestError("a message is a JSON object with an op")
    return found


def read_request(found: Mapping[str, Any], *, chars: int = 0) -> Request:
    """The request of a JSON object; InvalidRequestError names the field that does not fit."""
    op = found.get("op")
    if op == "auth":
        raise InvalidRequestError("rosauth is not spoken here: put a ticket or key into the address, ?token=…")
    make = OPS.get(op) if isinstance(op, str) else None
    if make is None:
        raise InvalidRequestError(f"op {str(op)[:40]!r} is none of {', '.join([*OPS, 'fragment'])}")
    said = found.get("id")
    name = said if isinstance(said, str) or said is None else str(said)
    if name is not None and len(name) > NAME_CHARS:
        raise InvalidRequestError(f"id has at most {NAME_CHARS} characters")
    return make(found, op=str(op), id=name, chars=chars)


def _lenient(frame: str | bytes, error: Exception) -> Any:
    """NaN is no JSON, and roslibpy sends it."""
    text = frame if isinstance(frame, str) else frame.decode("utf-8", "replace")
    if "NaN" not in text and "Infinity" not in text:
        raise InvalidRequestError(f"no JSON: {error}") from None
    try:
        found = json.loads(text)
        orjson.dumps(found)  # numbers and texts that nobody else could write are refused here
    except (ValueError, TypeError, RecursionError) as second:
        raise InvalidRequestError(f"no JSON: {str(second)[:200]}") from None
    return found


def _text(found: Mapping[str, Any], name: str, default: str | None = None) -> str:
    value = found.get(name)
    if value is None and default is not None:
        return default
    if not isinstance(value, str) or not value or len(value) > NAME_CHARS or "\0" in value:
        raise InvalidRequestError(f"{name} is a text of at most {NAME_CHARS} characters")
    return value


def _optional(found: Mapping[str, Any], name: str) -> str:
    return "" if found.get(name) in (None, "") else _text(found, name)


def _name(found: Mapping[str, Any], name: str) -> str:
    return _text(found, name)


def _type(found: Mapping[str, Any], name: str = "type") -> str:
    """The type's name, "" for none: some clients send an empty one, or "*"."""
    value = found.get(name)
    return "" if value in (None, "", "*") else _text(found, name)


def _number(found: Mapping[str, Any], name: str, *, high: float) -> float:
    value = found.get(name)
    if value is None:
        return 0.0
    if not isinstance(value, int | float) or isinstance(value, bool) or not -high <= value <= high:
        raise InvalidRequestError(f"{name} is a number of at most {high:g}")
    return max(0.0, float(value))


def _shape(found: Mapping[str, Any]) -> Shape:
    size = int(_number(found, "fragment_size", high=2**31))
    compression = _text(found, "compression", "none")
    if compression not in COMPRESSIONS:
        raise InvalidRequestError(f"compression is one of {', '.join(COMPRESSIONS)}")
    return Shape(fragment_size=size or None, compression=compression)


def _advertise(found: Mapping[str, Any], **more: Any) -> Request:
    return Advertise(topic=_name(found, "topic"), type_name=_type(found), **more)


def _publish(found: Mapping[str, Any], **more: Any) -> Request:
    message = found.get("msg", {})
    return Publish(
        topic=_name(found, "topic"),
        message=message,
        type_name=_type(found),
        lease_id=_optional(found, "lease_id"),
        sent_ns=int(_number(found, "sent_ns", high=2**62)),
        **more,
    )


def _subscribe(found: Mapping[str, Any], **more: Any) -> Request:
    return Subscribe(
        topic=_name(found, "topic"),
        type_name=_type(found),
        throttle_s=_number(found, "throttle_rate", high=MAX_MS) / 1000,
        queue_length=int(_number(found, "queue_length", high=MAX_QUEUE)),
        shape=_shape(found),
        **more,
    )


def _call(found: Mapping[str, Any], **more: Any) -> Request:
    timeout_s = _number(found, "timeout", high=1e9)
    return CallService(
        service=_name(found, "service"),
        args=found.get("args"),
        type_name=_type(found),
        timeout_s=min(timeout_s, MAX_TIMEOUT_S) if timeout_s else None,
        lease_id=_optional(found, "lease_id"),
        shape=_shape(found),
        **more,
    )


def _response(found: Mapping[str, Any], **more: Any) -> Request:
    result = found.get("result", True)
    return ServiceResponse(values=found.get("values"), result=bool(result), **more)


def _goal(found: Mapping[str, Any], **more: Any) -> Request:
    if more["id"] is None:
        raise InvalidRequestError("send_action_goal needs an id: feedback and result carry it")
    return SendGoal(
        action=_name(found, "action"),
        type_name=_type(found, "action_type"),
        args=found.get("args"),
        feedback=bool(found.get("feedback", False)),
        lease_id=_optional(found, "lease_id"),
        shape=_shape(found),
        **more,
    )


def _result(found: Mapping[str, Any], **more: Any) -> Request:
    result, status = bool(found.get("result", True)), found.get("status")
    if not isinstance(status, int) or isinstance(status, bool):
        status = 4 if result else 6
    return ActionResult(values=found.get("values"), status=status, result=result, **more)


def _level(found: Mapping[str, Any], **more: Any) -> Request:
    level = _text(found, "level")
    if level not in LEVELS:
        raise InvalidRequestError(f"level is one of {', '.join(LEVELS)}")
    return SetLevel(level=level, **more)


OPS: dict[str, Callable[..., Request]] = {
    "advertise": _advertise,
    "unadvertise": lambda found, **more: Unadvertise(topic=_name(found, "topic"), **more),
    "publish": _publish,
    "subscribe": _subscribe,
    "unsubscribe": lambda found, **more: Unsubscribe(topic=_name(found, "topic"), **more),
    "call_service": _call,
    "advertise_service": lambda found, **more: Offer(name=_name(found, "service"), type_name=_type(found), **more),
    "unadvertise_service": lambda found, **more: Unoffer(name=_name(found, "service"), **more),
    "service_response": _response,
    "send_action_goal": _goal,
    "cancel_action_goal": lambda found, **more: CancelGoal(action=_name(found, "action"), **more),
    "advertise_action": lambda found, **more: Offer(name=_name(found, "action"), type_name=_type(found), **more),
    "unadvertise_action": lambda found, **more: Unoffer(name=_name(found, "action"), **more),
    "action_feedback": lambda found, **more: ActionFeedback(values=found.get("values"), **more),
    "action_result": _result,
    "set_level": _level,
}
