"""Plain Python values over topics, and as the ROS types that others see."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import metaros
from metaros.errors import DecodeError, FieldError, UsageError
from metaros.interfaces.metaros_msgs.msg import Json
from metaros.interfaces.std_msgs.msg import String
from metaros.node.plain_values import PLAIN, value_codec_of
from tests.support.waiting import wait_until

VALUES: list[tuple[Any, Any]] = [
    (str, "grüß dich"),
    (bool, True),
    (int, -(2**60)),
    (float, 0.1),
    (bytes, b"\0\1\0\0CDR?"),
    (dict, {"a": [1, None, {"ü": 2.5}], "b": True}),
    (list, [1, "zwei", {"drei": 3}]),
]


def turn(node: metaros.Node) -> Callable[[], None]:
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    return lambda: (executor.spin_once(0.01), None)[1]


@pytest.mark.parametrize(("kind", "value"), VALUES)
def test_a_plain_value_crosses_and_stays_what_it_is(here, there, kind, value):
    got: list[Any] = []
    with metaros.Node("a", context=here) as a, metaros.Node("b", context=there) as b:
        b.create_subscription(kind, "/plain", got.append)
        publisher = a.create_publisher(kind, "/plain")
        spin = turn(b)
        wait_until(lambda: (publisher.publish(value), spin(), got)[-1])
        assert publisher.type_name == PLAIN[kind].type_name
    assert got[0] == value
    assert type(got[0]) is kind


def test_ros_sees_a_string_and_sends_one(here, there):
    plain: list[str] = []
    typed: list[Any] = []
    with metaros.Node("a", context=here) as a, metaros.Node("b", context=there) as b:
        b.create_subscription(String, "/out", typed.append)
        a.create_subscription(str, "/in", plain.append)
        out, back = a.create_publisher(str, "/out"), b.create_publisher(String, "/in")
        spins = turn(a), turn(b)

        def both() -> bool:
            out.publish("hello")
            back.publish(String(data="and back"))
            [spin() for spin in spins]
            return bool(plain and typed)

        wait_until(both)
    assert (plain[0], typed[0]) == ("and back", String(data="hello"))


@pytest.mark.parametrize(
    ("kind", "value", "message"),
    [
        (str, b"x", "the topic carries str, not bytes"),
        (int, True, "the topic carries int, not bool"),
        (int, 1.5, "the topic carries int, not float"),
        (int, 2**63, "data: 9223372036854775808 does not fit int64"),
        (float, "1", "the topic carries float, not str"),
        (bool, 1, "the topic carries bool, not int"),
        (bytes, "x", "the topic carries bytes, not str"),
        (dict, {"a": {1, 2}}, "the dict cannot be JSON: Object of type set is not JSON serializable"),
        (dict, {"a": math.nan}, "the dict cannot be JSON"),
        (list, {}, "the topic carries list, not dict"),
    ],
)
def test_other_values_are_refused_before_they_go(here, kind, value, message):
    with metaros.Node("a", context=here) as node:
        publisher = node.create_publisher(kind, "/plain")
        with pytest.raises(FieldError, match=message.replace("(", r"\(")):
            publisher.publish(value)


def test_numbers_of_numpy_are_numbers():
    assert value_codec_of(int).decode(value_codec_of(int).encode(np.int32(7))) == 7
    assert value_codec_of(float).decode(value_codec_of(float).encode(np.float32(0.5))) == 0.5
    assert value_codec_of(bytes).encode(memoryview(b"ab")) == value_codec_of(bytes).encode(b"ab")


@pytest.mark.parametrize("text", ["{", "[1]", "NaN", '{"a": Infinity}', '{"a": 1e999}', "[" * 100_000])
def test_json_of_a_careless_peer_is_a_decode_error(text):
    data = value_codec_of(Json).encode(Json(data=text))
    with pytest.raises(DecodeError):
        value_codec_of(dict).decode(data)


class Plain:
    """No message."""


@pytest.mark.parametrize("kind", [Plain, set, None, "std_msgs/msg/String"])
def test_what_is_no_message_type_is_said(here, kind):
    with metaros.Node("a", context=here) as node:
        with pytest.raises(
            UsageError, match=r"decorate the class with @metaros\.message, or use one of str, bool, int"
        ):
            node.create_publisher(kind, "/x")
        with pytest.raises(UsageError, match="is no message type"):
            node.create_subscription(kind, "/x", print)


JSON = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=8),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=4), inner, max_size=4),
    max_leaves=12,
)


@settings(max_examples=40, deadline=None)
@given(st.dictionaries(st.text(st.characters(exclude_categories=["Cs"]), max_size=6), JSON, max_size=4))
def test_any_json_object_comes_back(value):
    try:
        data = value_codec_of(dict).encode(value)
    except FieldError:  # lone surrogates in keys
        return
    assert value_codec_of(dict).decode(data) == value
