"""`check_fields=True`: fields that refuse what does not fit them when it is set, not when it is published."""

from __future__ import annotations

import collections
import math
from array import array
from collections.abc import Callable, Sequence, Set
from typing import Any

from metaros.idl.arrays import DTYPES, TYPE_CODES
from metaros.idl.definitions import INTEGER_RANGES, Field, FieldType
from metaros.ros2.rosidl.held import is_numbers

__all__ = ["checker"]

_LARGEST = {"float32": 3.402823466e38, "float64": 1.7976931348623157e308}


def checker(field: Field, nested: type[Any] | None) -> Callable[[Any], None]:
    """A function that raises AssertionError for what the field cannot hold; `nested` is the class of its messages."""
    name, kind = field.name, field.type
    check_one = _single(kind, nested)

    def check(value: Any) -> None:
        trouble = _trouble(kind, value, check_one)
        if trouble:
            raise AssertionError(f"The field {name!r} ({kind.text(slots=True)}) {trouble}")

    return check


def _trouble(kind: FieldType, value: Any, check_one: Callable[[Any], str]) -> str:
    if not kind.array:
        return check_one(value)
    if is_numbers(kind):
        if isinstance(value, array):
            code = TYPE_CODES[kind.base]
            wrong = f"takes an array.array of type code {code!r}, not {value.typecode!r}"
            return wrong if value.typecode != code else _length(kind, len(value))
        if hasattr(value, "dtype") and kind.array == "fixed":
            wrong = f"takes a numpy array of {DTYPES[kind.base]}, not of {value.dtype}"
            return wrong if value.dtype != DTYPES[kind.base] else _length(kind, int(value.size))
    if not isinstance(value, (Sequence, Set)) or isinstance(value, (str, collections.UserString)):
        return f"must be a sequence, not {_kind(value)}"
    if kind.base == "byte" and isinstance(value, (bytes, bytearray)):
        return _length(kind, len(value))
    troubles = (check_one(item) for item in value)
    return _length(kind, len(value)) or next((f"has an element that {text}" for text in troubles if text), "")


def _length(kind: FieldType, count: int) -> str:
    if kind.array == "fixed" and count != kind.capacity:
        return f"must have {kind.capacity} elements, not {count}"
    if kind.array == "bounded" and count > kind.capacity:
        return f"can have at most {kind.capacity} elements, not {count}"
    return ""


def _single(kind: FieldType, nested: type[Any] | None) -> Callable[[Any], str]:
    """A function that says what is wrong with one value, or nothing."""
    if nested is not None:
        wanted = nested.__name__
        return lambda value: "" if isinstance(value, nested) else f"must be a {wanted}, not {_kind(value)}"
    if kind.is_string:
        return lambda value: _text(kind.string_bound, value)
    if kind.base == "bool":
        return lambda value: "" if isinstance(value, bool) else f"must be a bool, not {_kind(value)}"
    if kind.base == "byte":
        return _octet
    if kind.base in INTEGER_RANGES:
        low, high = INTEGER_RANGES[kind.base]
        return lambda value: _integer(low, high, value)
    largest = _LARGEST[kind.base]
    return lambda value: _number(largest, value)


def _text(bound: int, value: Any) -> str:
    if not isinstance(value, (str, collections.UserString) if bound else str):
        return f"must be a str, not {_kind(value)}"
    return f"must not be longer than {bound}; it has {len(value)} characters" if 0 < bound < len(value) else ""


def _octet(value: Any) -> str:
    if isinstance(value, (bytes, bytearray, memoryview)) and len(value) == 1:
        return ""
    return f"must be bytes of length 1, such as b'\\x02', not {value!r:.40}"


def _integer(low: int, high: int, value: Any) -> str:
    if not isinstance(value, int):
        return f"must be an int, not {_kind(value)}"
    return "" if low <= value <= high else f"must be between {low} and {high}, not {value}"


def _number(largest: float, value: Any) -> str:
    if not isinstance(value, float):
        return f"must be a float, not {_kind(value)}"
    return f"must not be beyond ±{largest}" if largest < abs(value) and not math.isinf(value) else ""


def _kind(value: Any) -> str:
    return type(value).__name__
