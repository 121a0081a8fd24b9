"""Hello, declarations and pongs: read as documented, refused with a reason."""

from __future__ import annotations

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from metaros.drivers.serial.channels import may_use
from metaros.drivers.serial.outgoing import Outgoing
from metaros.drivers.serial.protocol import Declare, Hello, parse_declare, parse_hello, pong
from metaros.errors import DecodeError


def declaration(direction: int, topic: bytes, type_name: bytes) -> bytes:
    return bytes((direction, len(topic))) + topic + bytes((len(type_name),)) + type_name


def test_hello_and_declare() -> None:
    assert parse_hello(b"\x01\x2a\0\0\0pump") == Hello(42, "pump")
    assert parse_declare(3, declaration(1, b"led", b"std_msgs/msg/Bool")) == Declare(
        3, False, "led", "std_msgs/msg/Bool"
    )
    assert pong(b"\1\2\3\4", 5) == b"\1\2\3\4" + (5).to_bytes(8, "little")


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        (b"", "at least 5"),
        (b"\x02\0\0\0\0x", "version 2"),
        (b"\x01\0\0\0\0\xff", "not UTF-8"),
        (b"\x01\0\0\0\0" + b"n" * 33, "at most 32"),
        (b"\x01\0\0\0\0a\x1b[2J", "control characters"),
    ],
)
def test_a_wrong_hello_is_refused(payload: bytes, reason: str) -> None:
    with pytest.raises(DecodeError, match=reason):
        parse_hello(payload)


@pytest.mark.parametrize(
    "payload",
    [b"", b"\0", b"\2\1a\1b", b"\0\5abc", declaration(0, b"a", b"b") + b"more", declaration(0, b"t" * 129, b"b")],
)
def test_a_wrong_declaration_is_refused(payload: bytes) -> None:
    with pytest.raises(DecodeError):
        parse_declare(0, payload)


@given(st.binary(max_size=300))
def test_nothing_else_is_raised(payload: bytes) -> None:
    for parse in (parse_hello, lambda data: parse_declare(1, data), lambda data: pong(data, 1)):
        with contextlib.suppress(DecodeError):
            parse(payload)


def test_what_moves_something_must_be_named() -> None:
    assert may_use("bumper", "**")
    assert may_use("arm/bumper", "arm/*,leds")
    assert not may_use("leg/bumper", "arm/*,leds")
    assert not may_use("cmd_vel", "**")
    assert not may_use("arm/cmd_vel", "arm/*")
    assert may_use("cmd_vel", "**, cmd_vel")
    assert not may_use("bumper", "")


def test_the_newest_message_of_a_channel_waits() -> None:
    counts: list[str] = []
    outgoing = Outgoing(counts.append)
    outgoing.put(1, b"old")
    outgoing.put(2, b"other")
    outgoing.put(1, b"new")
    outgoing.control(b"first")
    assert [outgoing.take(0) for _ in range(4)] == [b"first", (2, b"other"), (1, b"new"), None]
    assert counts == ["skipped_to_board"]
    for number in range(1000):
        outgoing.control(bytes((number % 256,)))
    assert sum(outgoing.take(0) is not None for _ in range(100)) == 64
