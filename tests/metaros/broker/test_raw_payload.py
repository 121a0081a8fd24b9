"""Payloads that go through nearly as they are."""

from __future__ import annotations

from typing import Any

import pytest

from metaros.broker.frames import parse_payload
from metaros.broker.raw_payload import raw_data
from metaros.broker.type_inference import BYTES, JSON, TEXT
from metaros.broker.v1_json import to_payload
from metaros.errors import FieldError
from metaros.idl import message_class


@pytest.mark.parametrize(
    ("name", "payload", "data"),
    [
        (TEXT, b"hello", "hello"),
        (TEXT, b'"hello"', "hello"),
        (TEXT, b"21.5", "21.5"),
        (TEXT, b'{"a": 1}', '{"a": 1}'),
        (TEXT, b'{"data": "hello"}', None),
        (JSON, b'{"a": [1, null]}', '{"a": [1, null]}'),
        (JSON, b'{"a": NaN, "b": [Infinity]}', '{"a": null, "b": [null]}'),
        (JSON, b"hello", '"hello"'),
        (BYTES, b'{"a": 1}', b'{"a": 1}'),
        (BYTES, b"\xff", b"\xff"),
        ("std_msgs/msg/Float64", b"21.5", None),
    ],
)
def test_data(name: str, payload: bytes, data: Any) -> None:
    assert raw_data(name, parse_payload(payload), payload) == data


@pytest.mark.parametrize("name", [TEXT, JSON])
def test_bytes_are_no_text(name: str) -> None:
    with pytest.raises(FieldError, match="UTF-8"):
        raw_data(name, b"\xff", b"\xff")


def test_payloads() -> None:
    assert to_payload(message_class(JSON)(data='{"a": 1}')) == b'{"a": 1}'
    assert to_payload(message_class(BYTES)(data=b"\x00\xff")) == b"\x00\xff"
    assert to_payload(message_class(TEXT)(data="a")) == b'{"data":"a"}'
    with pytest.raises(FieldError, match="no JSON"):
        to_payload(message_class(JSON)(data="{"))
