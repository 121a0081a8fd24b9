"""Messages from the values that rosbridge clients send: base64 or lists for bytes, ROS 1's times, stamps filled. Pure.

What is left out has its default. A header without a stamp gets the time now, as with rosbridge; so does a message
whose header is left out altogether.
"""

from __future__ import annotations

import base64
import binascii
from typing import Any

import numpy as np

from gateway.api.rosbridge.from_message import BYTES
from metaros.errors import FieldError
from metaros.idl.classes import Message, message_class
from metaros.idl.definitions import Field, FieldType
from metaros.idl.json import from_json

__all__ = ["arguments", "message_of"]

HEADER = "std_msgs/msg/Header"
TIMES = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
ROS1_TIME = {"secs": "sec", "nsecs": "nanosec"}
MAX_DEPTH = 64

Patch = tuple[tuple[str | int, ...], Any]  # where in the message an array goes that JSON wrote as one text


def message_of(cls: type[Any], value: Any, *, now_ns: int) -> Any:
    """The message of class `cls` that `value` describes; FieldError names the path of what does not fit."""
    patches: list[Patch] = []
    plain = _plain(cls, value, now_ns, (), patches)
    if isinstance(plain, dict) and "header" not in plain and _has_header(cls):
        plain["header"] = {"stamp": _stamp(now_ns)}
    message = from_json(cls, plain)
    for path, array in patches:
        target: Any = message
        for step in path[:-1]:
            target = target[step] if isinstance(step, int) else getattr(target, step)
        setattr(target, str(path[-1]), array)
    return message


def arguments(cls: type[Any], value: Any) -> Any:
    """A service's arguments by name, where a list gives them in the order of the type's fields."""
    if value is None:
        return {}
    if not isinstance(value, list):
        return value
    fields = cls.__metaros_fields__
    if len(value) > len(fields):
        raise FieldError(f"args: {len(value)} values, {cls.__metaros_name__} has {len(fields)} fields")
    return {field.name: item for field, item in zip(fields, value, strict=False)}


def _plain(cls: type[Message], value: Any, now_ns: int, path: tuple[str | int, ...], patches: list[Patch]) -> Any:
    """`value` as `from_json` takes it; what is no object is its to refuse."""
    if not isinstance(value, dict) or len(path) > MAX_DEPTH:
        return value
    if cls.__metaros_name__ in TIMES:
        return {ROS1_TIME.get(name, name): item for name, item in value.items()}
    known = {field.name: field for field in cls.__metaros_fields__}
    made: dict[str, Any] = {}
    for name, item in value.items():
        field = known.get(name)
        if field is None:
            made[name] = item
        elif field.type.array and field.type.base in BYTES and isinstance(item, str):
            patches.append(((*path, field.attribute), _bytes(field, item)))
        else:
            made[name] = _nested(cls, field.type, item, now_ns, (*path, field.attribute), patches)
    if cls.__metaros_name__ == HEADER and "stamp" not in made:
        made["stamp"] = _stamp(now_ns)
    return made


def _nested(
    cls: type[Message], kind: FieldType, item: Any, now_ns: int, path: tuple[str | int, ...], patches: list[Patch]
) -> Any:
    if not kind.is_nested:
        return item
    inner = message_class(kind.base, cls.__metaros_catalogue__)
    if not kind.array:
        return _plain(inner, item, now_ns, path, patches)
    if not isinstance(item, list):
        return item
    return [_plain(inner, one, now_ns, (*path, index), patches) for index, one in enumerate(item)]


def _bytes(field: Field, text: str) -> Any:
    """A one-byte array from base64, which may lack its padding."""
    try:
        found = base64.b64decode(text + "=" * (-len(text) % 4), validate=True)
    except (binascii.Error, ValueError) as error:
        raise FieldError(f"{field.name}: a text for {field.type.base}[] is base64: {error}") from None
    kind, count = field.type, len(found)
    if kind.array == "fixed" and count != kind.capacity:
        raise FieldError(f"{field.name}: {count} elements, exactly {kind.capacity} are needed")
    if kind.array == "bounded" and count > kind.capacity:
        raise FieldError(f"{field.name}: {count} elements, at most {kind.capacity} are allowed")
    return np.frombuffer(found, np.uint8)


def _has_header(cls: type[Message]) -> bool:
    return any(field.name == "header" and field.type.base == HEADER for field in cls.__metaros_fields__)


def _stamp(now_ns: int) -> dict[str, int]:
    sec, nanosec = divmod(now_ns, 1_000_000_000)
    return {"sec": sec, "nanosec": nanosec}
