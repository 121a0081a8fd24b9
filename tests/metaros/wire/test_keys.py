"""Data keys: what is written, what is read, what is refused."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from metaros.errors import NameError_
from metaros.wire import DataKey, dds_name, parse_key, ros_name
from metaros.wire.names import NO_HASH, mangle, unmangle

HASH = "RIHS01_" + "a" * 64


def test_a_key_has_domain_name_type_and_hash():
    key = DataKey(2, "/robot1/chatter", "std_msgs/msg/String", HASH)
    assert str(key) == f"2/robot1/chatter/std_msgs::msg::dds_::String_/{HASH}"
    assert parse_key(str(key)) == key


def test_the_tap_of_any_release_leaves_the_hash_open():
    assert DataKey(0, "/odom", "nav_msgs/msg/Odometry", NO_HASH).any_hash() == "0/odom/nav_msgs::msg::dds_::Odometry_/*"


@pytest.mark.parametrize(
    "topic",
    ["", "/", "//a", "a//b", "a/", "1a", "a b", "a#b", "a?b", "a*", "$a", "ä", "a" * 300, "~/x", "{a}", "a\n", "a\0"],
)
def test_a_name_with_illegal_characters_is_a_named_error(topic):
    with pytest.raises(NameError_) as caught:
        str(DataKey(0, topic, "std_msgs/msg/String", HASH))
    assert caught.value.code == "invalid_name"


@pytest.mark.parametrize(
    ("domain", "type_name", "type_hash"),
    [
        (-1, "std_msgs/msg/String", HASH),
        (233, "std_msgs/msg/String", HASH),
        (0, "String", HASH),
        (0, "std_msgs/String", HASH),
        (0, "std_msgs/msg/Str*ng", HASH),
        (0, "std_msgs/msg/String", "**"),
        (0, "std_msgs/msg/String", ""),
    ],
)
def test_domain_type_and_hash_are_checked_too(domain, type_name, type_hash):
    with pytest.raises(NameError_):
        str(DataKey(domain, "/chatter", type_name, type_hash))


@settings(max_examples=50)
@given(
    st.one_of(st.text(), st.lists(st.sampled_from(["0", "a", "**", "", "x::msg::dds_::Y_", HASH, "é"])).map("/".join))
)
def test_any_text_is_a_key_or_a_name_error(text):
    try:
        key = parse_key(text)
    except NameError_:
        return
    assert str(key) == text


def test_types_of_services_and_actions_are_spelt_the_same_way():
    for name in ("example_interfaces/srv/AddTwoInts", "example_interfaces/action/Fibonacci_SendGoal"):
        assert ros_name(dds_name(name)) == name


@settings(max_examples=50)
@given(st.text())
def test_mangling_is_undone(text):
    if "%" not in text:
        assert unmangle(mangle(text)) == text
