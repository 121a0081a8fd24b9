"""What the frames mean: docs/reference/serial_boards.md. Pure."""

from __future__ import annotations

import struct
from enum import IntEnum
from typing import Final, NamedTuple

from metaros.errors import DecodeError

__all__ = ["VERSION", "Answer", "Declare", "FromBoard", "Hello", "ToBoard", "parse_declare", "parse_hello", "pong"]

VERSION: Final = 1
MAX_NAME: Final = 32
MAX_TOPIC: Final = 128
MAX_TYPE: Final = 96


class FromBoard(IntEnum):
    """Kinds of frames that a board sends."""

    HELLO = 0x01  # version u8, boot u32, name: at its start, and when asked
    DECLARE = 0x02  # channel; direction u8 (0 publishes, 1 subscribes), length u8, topic, length u8, type
    DATA = 0x03  # channel; CDR with its 4-byte header
    LOG = 0x04  # the channel is the level (10, 20, 30, 40, 50); text
    PING = 0x05  # token u32: what time is it?


class ToBoard(IntEnum):
    """Kinds of frames that a board receives."""

    ASK = 0x81  # version u8: say hello and declare
    ANSWER = 0x82  # channel; an Answer: to a declaration
    DATA = 0x83  # channel; CDR with its 4-byte header
    PONG = 0x85  # token u32, nanoseconds since the Unix epoch u64


class Answer(IntEnum):
    """What becomes of a declaration."""

    ACCEPTED = 0
    UNKNOWN_TYPE = 1
    BAD_TOPIC = 2
    NOT_ALLOWED = 3
    TOO_MANY = 4


class Hello(NamedTuple):
    """A board names itself; another `boot` than before: it has forgotten everything."""

    boot: int
    name: str


class Declare(NamedTuple):
    """A board's topic."""

    channel: int
    publishes: bool
    topic: str
    type_name: str


def parse_hello(payload: bytes) -> Hello:
    """Raises DecodeError."""
    if len(payload) < 5:
        raise DecodeError(f"hello of {len(payload)} bytes: at least 5 are required")
    if payload[0] != VERSION:
        raise DecodeError(f"the board speaks version {payload[0]}, this driver {VERSION}")
    return Hello(int.from_bytes(payload[1:5], "little"), _text(payload[5:], MAX_NAME, "name"))


def parse_declare(channel: int, payload: bytes) -> Declare:
    """Raises DecodeError."""
    if len(payload) < 2 or payload[0] > 1:
        raise DecodeError("declaration without direction, topic and type")
    topic, rest = _counted(payload[1:], MAX_TOPIC, "topic")
    type_name, rest = _counted(rest, MAX_TYPE, "type")
    if rest:
        raise DecodeError(f"{len(rest)} bytes too many behind a declaration")
    return Declare(channel, payload[0] == 0, topic, type_name)


def pong(payload: bytes, wall_ns: int) -> bytes:
    """The answer to a PING: its token and the time. Raises DecodeError."""
    if len(payload) != 4:
        raise DecodeError(f"ping of {len(payload)} bytes: 4 are required")
    return payload + struct.pack("<Q", wall_ns)


def _counted(data: bytes, most: int, what: str) -> tuple[str, bytes]:
    if not data or len(data) < 1 + data[0]:
        raise DecodeError(f"the {what} is cut short")
    return _text(data[1 : 1 + data[0]], most, what), data[1 + data[0] :]


def _text(data: bytes, most: int, what: str) -> str:
    if len(data) > most:
        raise DecodeError(f"a {what} of {len(data)} bytes; at most {most}")
    try:
        text = data.decode()
    except UnicodeDecodeError:
        raise DecodeError(f"the {what} is not UTF-8") from None
    if not text.isprintable():
        raise DecodeError(f"the {what} has control characters")
    return text
