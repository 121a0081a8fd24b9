"""Fields of requests that gRPC's own types do not check: JSON texts, speeds, stamps; a fault names its field."""

from __future__ import annotations

import math
from typing import Any

import orjson

from gateway.errors import InvalidRequestError
from metaros.limits import LIMITS

__all__ = ["FieldFaultError", "document", "speed", "stamp", "text_of"]

MAX_SPEED = 100.0  # m/s and rad/s, as on the teleop socket
MAX_STAMP = 2**62


class FieldFaultError(InvalidRequestError):
    """A field of the request does not fit; the status details name it, see errors.py."""

    def __init__(self, field: str, text: str) -> None:
        super().__init__(text)
        self.field = field


def document(text: str, name: str) -> dict[str, Any]:
    """A JSON object; "" is an empty one. InvalidRequestError names the field."""
    if not text:
        return {}
    if len(text) > LIMITS.json_bytes:
        raise FieldFaultError(name, f"{name} has at most {LIMITS.json_bytes} bytes")
    try:
        value = orjson.loads(text)
    except orjson.JSONDecodeError as error:
        raise FieldFaultError(name, f"{name} is no JSON: {error}") from error
    if not isinstance(value, dict):
        raise FieldFaultError(name, f"{name} is a JSON object")
    return value


def text_of(value: Any) -> str:
    """JSON as REST writes it."""
    return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS).decode()


def speed(value: float, name: str) -> float:
    """A speed that may be sent on."""
    if not (math.isfinite(value) and abs(value) <= MAX_SPEED):
        raise FieldFaultError(name, f"linear and angular are numbers from -{MAX_SPEED:g} to {MAX_SPEED:g}")
    return value


def stamp(sent_ns: int) -> int:
    """A client's wall clock."""
    if not 0 <= sent_ns < MAX_STAMP:
        raise FieldFaultError("sent_ns", "sent_ns is in nanoseconds since 1970; 0 is now")
    return sent_ns
