"""Type names and values as people type them."""

from __future__ import annotations

import pytest

from metaros.cli.shared.types import example, full_type, parse_values
from metaros.errors import FieldError, UnknownTypeError, UsageError
from metaros.idl import message_class
from metaros.idl.json import from_json
from tests.support.tables import cases


@cases(
    ("typed", "kind", "full"),
    [
        ("std_msgs/msg/String", "msg", "std_msgs/msg/String"),
        ("std_msgs/String", "msg", "std_msgs/msg/String"),
        ("std_srvs/Trigger", "srv", "std_srvs/srv/Trigger"),
    ],
)
def test_the_short_form_is_accepted(typed: str, kind: str, full: str) -> None:
    assert full_type(typed, kind) == full


@cases(("typed", "hint"), [("std_msgs/Strng", "std_msgs/msg/String"), ("Odometry", "nav_msgs/msg/Odometry")])
def test_a_typo_gets_a_hint(typed: str, hint: str) -> None:
    with pytest.raises(UnknownTypeError, match=hint):
        full_type(typed)


def test_values_are_yaml_and_may_be_partial() -> None:
    values = parse_values("{linear: {x: 0.3}}", "geometry_msgs/msg/Twist")
    message = from_json(message_class("geometry_msgs/msg/Twist"), values)
    assert (message.linear.x, message.linear.y, message.angular.z) == (0.3, 0.0, 0.0)
    assert parse_values("data: hi", "std_msgs/msg/String") == {"data": "hi"}
    assert parse_values("  ", "std_msgs/msg/String") == {}


def test_what_is_no_yaml_is_an_error_with_an_example() -> None:
    with pytest.raises(UsageError, match="data: text"):
        parse_values("{data: [", "std_msgs/msg/String")


def test_what_is_no_dictionary_is_an_error_with_an_example() -> None:
    with pytest.raises(FieldError, match="data: text"):
        parse_values("hello", "std_msgs/msg/String")


def test_examples_are_valid_themselves() -> None:
    for name in ("std_msgs/msg/String", "sensor_msgs/msg/LaserScan", "geometry_msgs/msg/Twist", "std_msgs/msg/Bool"):
        from_json(message_class(name), parse_values(example(name), name))
