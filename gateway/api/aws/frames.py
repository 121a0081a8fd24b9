"""Frames of `application/vnd.amazon.eventstream`: lengths, headers, a payload, and two checksums."""

from __future__ import annotations

import struct
from binascii import crc32

__all__ = ["EVENT_STREAM", "event_frame"]

EVENT_STREAM = "application/vnd.amazon.eventstream"
_TEXT = 7  # the type of a header's value


def event_frame(kind: str, payload: bytes, *, content_type: str) -> bytes:
    """One event of a stream."""
    return _frame({":message-type": "event", ":event-type": kind, ":content-type": content_type}, payload)


def _frame(headers: dict[str, str], payload: bytes) -> bytes:
    lines = b"".join(_header(name.encode(), value.encode()) for name, value in headers.items())
    prelude = struct.pack(">II", 16 + len(lines) + len(payload), len(lines))
    message = b"".join((prelude, struct.pack(">I", crc32(prelude)), lines, payload))
    return message + struct.pack(">I", crc32(message))


def _header(name: bytes, value: bytes) -> bytes:
    return struct.pack(">B", len(name)) + name + struct.pack(">BH", _TEXT, len(value)) + value
