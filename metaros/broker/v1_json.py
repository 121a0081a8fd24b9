"""Messages as the JSON of `metaros` 1.x, and back: ROS 1's field names where they differ from ROS 2's. Pure.

Differences: `header.seq` and a `header.stamp` in seconds, a scan's `angles`, a path of poses with covariance, None for
"not set", an empty covariance for zeros. Whole arrays are listed, NaN and infinities are written as Python writes them
(`strict` makes them null).
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import Any, Final

import numpy as np

from metaros.broker.raw_payload import raw_payload
from metaros.errors import FieldError, TooLargeError
from metaros.idl import message_class
from metaros.idl.arrays import DTYPES, as_array
from metaros.idl.definitions import Field, FieldType
from metaros.idl.json import from_json
from metaros.limits import LIMITS

__all__ = ["from_payload", "to_payload"]

HEADER: Final = "std_msgs/msg/Header"
TIMES: Final = ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration")
SCAN: Final = "sensor_msgs/msg/LaserScan"
POSE_STAMPED: Final = "geometry_msgs/msg/PoseStamped"
_DROPPED: Final = {HEADER: {"seq"}, SCAN: {"angles"}, POSE_STAMPED: {"covariance"}}  # 1.x has them, ROS 2 has not
_MAX_TIME_S: Final = 1 << 31
_RENAMED: Final = {"secs": "sec", "nsecs": "nanosec"}  # how ROS 1 spells the parts of a time


def from_payload(cls: type[Any], value: Any, *, ignored: Callable[[str], object]) -> Any:
    """A message of `cls` from a parsed payload; FieldError names the field that does not fit.

    A value that is no object becomes the field `data`. Fields that the type lacks are left out and told to
    `ignored(path)`; where none is known, the payload is of another type.
    """
    if isinstance(value, dict):
        return _message(cls, value, "", ignored)
    if isinstance(value, bytes):
        value = np.frombuffer(value, np.uint8)
    return _message(cls, {"data": value}, "", ignored)


def _message(cls: type[Any], value: Any, path: str, ignored: Callable[[str], object]) -> Any:
    if cls.__metaros_name__ in TIMES and isinstance(value, int | float | None) and not isinstance(value, bool):
        return _time(cls, value, path)
    if not isinstance(value, dict):
        raise FieldError(f"{path or 'the message'}: expected an object")
    fields = {field.name: field for field in cls.__metaros_fields__}
    simple: dict[str, Any] = {}
    parts: dict[str, Any] = {}
    known = 0
    for name, item in value.items():
        field = fields.get(name) or fields.get(_RENAMED.get(name, ""))
        if field is None:
            if name not in _DROPPED.get(cls.__metaros_name__, ()):
                ignored(_where(path, name))
            continue
        known += 1
        _put(cls, field, item, simple, parts, path=_where(path, name), ignored=ignored)
    if value and not known and fields:
        raise FieldError(f"{path or 'the message'}: nothing in it is a field of {cls.__metaros_name__}")
    try:
        message = from_json(cls, simple)
    except FieldError as error:
        raise FieldError(_where(path, str(error))) from None
    for attribute, part in parts.items():
        setattr(message, attribute, part)
    return message


def _put(
    cls: type[Any],
    field: Field,
    item: Any,
    simple: dict[str, Any],
    parts: dict[str, Any],
    *,
    path: str,
    ignored: Callable[[str], object],
) -> None:
    """One field: numbers and texts are left to `from_json`, the rest is made here."""
    kind = field.type
    floating = kind.base.startswith("float")
    if item is None and not (floating and not kind.array):
        return  # "not set": the default
    if kind.array == "fixed" and isinstance(item, list) and not item:
        return
    if kind.is_nested:
        part = message_class(kind.base, cls.__metaros_catalogue__)
        if not kind.array:
            parts[field.attribute] = _message(part, item, path, ignored)
        elif isinstance(item, list):
            if kind.capacity and (len(item) > kind.capacity or (kind.array == "fixed" and len(item) != kind.capacity)):
                raise FieldError(f"{path}: {len(item)} elements do not fit {kind.capacity}")
            parts[field.attribute] = [_message(part, each, f"{path}[{n}]", ignored) for n, each in enumerate(item)]
        else:
            raise FieldError(f"{path}: expected a list")
    elif kind.array and kind.base in DTYPES and isinstance(item, list | np.ndarray):
        parts[field.attribute] = _numbers(kind, item, path)
    else:
        simple[field.name] = item


def _numbers(kind: FieldType, items: Any, path: str) -> Any:
    if isinstance(items, list):
        while items and isinstance(items[0], list):  # a matrix, as numpy's tolist() writes it
            if not all(isinstance(row, list) for row in items):
                raise FieldError(f"{path}: lists and numbers are mixed")
            items = [item for row in items for item in row]
        if kind.base.startswith("float") and None in items:
            items = [math.nan if item is None else item for item in items]
    try:
        values = as_array(items, kind.base)
    except FieldError as error:
        raise FieldError(f"{path}: {error}") from None
    if (kind.array == "fixed" and values.size != kind.capacity) or (
        kind.array == "bounded" and values.size > kind.capacity
    ):
        raise FieldError(f"{path}: {values.size} elements do not fit {kind.capacity}")
    return values


def _time(cls: type[Any], seconds: float | None, path: str) -> Any:
    if seconds is None:
        return cls()
    if not abs(seconds) < _MAX_TIME_S:
        raise FieldError(f"{path or 'the message'}: {seconds} is no time in seconds")
    whole, nanoseconds = divmod(round(seconds * 1e9), 1_000_000_000)
    return from_json(cls, {"sec": whole, "nanosec": nanoseconds})


def _where(path: str, name: str) -> str:
    return f"{path}.{name}" if path else name


def to_payload(message: Any, *, seq: int = 0, strict: bool = False) -> bytes:
    """The message as JSON; `seq` goes into its header. TooLargeError over `LIMITS.broker_message_bytes`."""
    plain = raw_payload(message)
    if plain is not None:
        return plain
    text = json.dumps(_plain_message(message, seq, strict), separators=(",", ":"), allow_nan=not strict)
    payload = text.encode()
    if len(payload) > LIMITS.broker_message_bytes:
        raise TooLargeError(f"a message of {len(payload)} bytes of JSON: the limit is {LIMITS.broker_message_bytes}")
    return payload


def _plain_message(message: Any, seq: int, strict: bool) -> dict[str, Any]:
    cls = type(message)
    plain = {
        field.name: _plain(field.type, getattr(message, field.attribute), seq, strict)
        for field in cls.__metaros_fields__
    }
    name = cls.__metaros_name__
    if name == HEADER:
        plain["stamp"] = message.stamp.sec + message.stamp.nanosec * 1e-9
        plain["seq"] = seq
    elif name == SCAN:
        first, step = message.angle_min, message.angle_increment
        angles = first + step * np.arange(len(message.ranges), dtype=np.float64)
        plain["angles"] = _listed(angles, strict)
    elif name == POSE_STAMPED:
        plain["covariance"] = []
    return plain


def _plain(kind: FieldType, value: Any, seq: int, strict: bool) -> Any:
    if kind.array and kind.base in DTYPES:
        return _listed(as_array(value, kind.base), strict)
    if kind.array:
        return [_plain(kind.element, item, seq, strict) for item in value]
    if kind.is_nested:
        return _plain_message(value, seq, strict)
    if kind.is_string or kind.base == "bool" or isinstance(value, int):
        return value
    number = float(value) if kind.base.startswith("float") else int(value)
    return None if strict and not math.isfinite(number) else number


def _listed(values: Any, strict: bool) -> list[Any]:
    items: list[Any] = values.ravel().tolist()
    if strict and values.dtype.kind == "f" and not np.isfinite(values).all():
        return [item if math.isfinite(item) else None for item in items]
    return items
