"""CDR as DDS writes it (XCDR1, little-endian), from the standard alone, over layouts that are plain Python.

A layout is a letter of `struct` for a number, "s" for a string, `[layout]` for a sequence, `(layout, n)` for an array
of n, and a dict for a structure: its fields in their order. A structure without fields has one byte, as in ROS 2.
"""

from __future__ import annotations

import struct
from typing import Any

__all__ = ["HEADER", "decode", "encode"]

HEADER = bytes([0, 1, 0, 0])


def encode(layout: Any, value: Any) -> bytes:
    """The bytes of a value, header included."""
    body = bytearray()
    _put(body, layout, value)
    return HEADER + bytes(body)


def decode(layout: Any, data: bytes) -> Any:
    """The value; every byte must belong to it."""
    assert data[:4] == HEADER, data[:4].hex()
    value, end = _take(data[4:], 0, layout)
    assert end == len(data) - 4, f"{len(data) - 4 - end} bytes more than the type has"
    return value


def _put(body: bytearray, layout: Any, value: Any) -> None:
    if isinstance(layout, dict):
        if not layout:
            body.append(0)
        for name, inner in layout.items():
            _put(body, inner, value[name])
    elif isinstance(layout, list):
        _put(body, "I", len(value))
        for item in value:
            _put(body, layout[0], item)
    elif isinstance(layout, tuple):
        assert len(value) == layout[1]
        for item in value:
            _put(body, layout[0], item)
    elif layout == "s":
        text = value.encode() + b"\0"
        _put(body, "I", len(text))
        body += text
    else:
        body += bytes(-len(body) % struct.calcsize(layout))
        body += struct.pack(f"<{layout}", value)


def _take(data: bytes, at: int, layout: Any) -> tuple[Any, int]:
    if isinstance(layout, dict):
        if not layout:
            return {}, at + 1
        fields = {}
        for name, inner in layout.items():
            fields[name], at = _take(data, at, inner)
        return fields, at
    if isinstance(layout, list | tuple):
        count = layout[1] if isinstance(layout, tuple) else 0
        if isinstance(layout, list):
            count, at = _take(data, at, "I")
        items = []
        for _ in range(count):
            item, at = _take(data, at, layout[0])
            items.append(item)
        return items, at
    if layout == "s":
        length, at = _take(data, at, "I")
        assert data[at + length - 1] == 0, "a string ends with a zero"
        return data[at : at + length - 1].decode(), at + length
    size = struct.calcsize(layout)
    at += -at % size
    (value,) = struct.unpack_from(f"<{layout}", data, at)
    return value, at + size
