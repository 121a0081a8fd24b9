"""Messages to the values that rosbridge clients get, as JSON and CBOR. Pure.

JSON: one-byte arrays are base64, and NaN and infinities are null, inside arrays too. CBOR: numeric arrays are tagged
little-endian byte strings (RFC 8746), one-byte arrays plain byte strings. How a type's fields become values is worked
out once a type.
"""

from __future__ import annotations

import base64
import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Any

import cbor2
import numpy as np
import orjson

from metaros.idl.arrays import DTYPES, as_array
from metaros.idl.definitions import INTEGER_RANGES, FieldType

__all__ = ["BYTES", "cbor_values", "json_bytes", "json_values"]

BYTES = ("uint8", "byte", "char")  # arrays of these are one text, or one byte string
MAX_PLANS = 1024
TAGS = {
    "uint16": 69,
    "uint32": 70,
    "uint64": 71,
    "int8": 72,
    "int16": 77,
    "int32": 78,
    "int64": 79,
    "float32": 85,
    "float64": 86,
}

Convert = Callable[[Any], Any]
Plan = tuple[tuple[str, str, Convert], ...]  # name, attribute, how its value is written


def json_values(message: Any) -> dict[str, Any]:
    """The fields of `message` as orjson writes them: numeric arrays stay numpy's, and NaN is made null there."""
    cls: Any = type(message)
    return {name: convert(getattr(message, attribute)) for name, attribute, convert in _json_plan(cls)}


def cbor_values(message: Any) -> dict[str, Any]:
    """The fields of `message` as CBOR's values; NaN stays NaN."""
    cls: Any = type(message)
    return {name: convert(getattr(message, attribute)) for name, attribute, convert in _cbor_plan(cls)}


def json_bytes(value: Any) -> bytes:
    """JSON text of what `json_values` gives, or of any JSON-able values: never NaN, never a lone surrogate."""
    try:
        return orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS)
    except TypeError:  # text that is no Unicode
        return orjson.dumps(_mended(value), option=orjson.OPT_SERIALIZE_NUMPY | orjson.OPT_NON_STR_KEYS)


@lru_cache(maxsize=MAX_PLANS)
def _json_plan(cls: Any) -> Plan:
    return tuple((field.name, field.attribute, _json_of(field.type)) for field in cls.__metaros_fields__)


@lru_cache(maxsize=MAX_PLANS)
def _cbor_plan(cls: Any) -> Plan:
    return tuple((field.name, field.attribute, _cbor_of(field.type)) for field in cls.__metaros_fields__)


def _json_of(kind: FieldType) -> Convert:
    if kind.array and kind.base in BYTES:
        return lambda value: base64.b64encode(as_array(value, kind.base).tobytes()).decode()
    if kind.array and kind.base in DTYPES:
        # orjson reads the memory itself: it has to be in one piece, and aligned.
        return lambda value: np.require(as_array(value, kind.base).ravel(), requirements=("C", "A"))
    if kind.array:
        one = _json_of(kind.element)
        return lambda value: [one(item) for item in value]
    return json_values if kind.is_nested else _single(kind)


def _cbor_of(kind: FieldType) -> Convert:
    if kind.array and kind.base in BYTES:
        return lambda value: as_array(value, kind.base).tobytes()
    if kind.array and kind.base in TAGS:
        tag = TAGS[kind.base]
        return lambda value: cbor2.CBORTag(tag, _little(as_array(value, kind.base)))
    if kind.array and kind.base in DTYPES:
        return lambda value: as_array(value, kind.base).ravel().tolist()
    if kind.array:
        one = _cbor_of(kind.element)
        return lambda value: [one(item) for item in value]
    return cbor_values if kind.is_nested else _single(kind)


def _single(kind: FieldType) -> Convert:
    if kind.is_string:
        return lambda value: str.__str__(value) if isinstance(value, str) else str(value)
    if kind.base == "bool":
        return bool
    return int if kind.base in INTEGER_RANGES else float


def _little(values: Any) -> bytes:
    if sys.byteorder == "big":
        values = values.byteswap()
    return bytes(values.tobytes())


def _mended(value: Any) -> Any:
    """The same with replacement characters for halves of characters."""
    if isinstance(value, str):
        return value.encode("utf-8", "replace").decode()
    if isinstance(value, dict):
        return {_mended(key): _mended(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_mended(item) for item in value]
    return value
