"""Values of messages of any type, out as JSON and CBOR and in again."""

from __future__ import annotations

import json
import math
from typing import Any

import cbor2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.api.rosbridge.from_message import TAGS, cbor_values, json_bytes, json_values
from gateway.api.rosbridge.to_message import arguments, message_of
from metaros.cdr import codec
from metaros.errors import FieldError
from metaros.idl import Catalogue, Field, FieldType, MessageDefinition, message_class
from metaros.idl.arrays import DTYPES
from metaros.interfaces.sensor_msgs.msg import BatteryState, CompressedImage, LaserScan
from metaros.interfaces.std_msgs.msg import Header, String
from tests.metaros.cdr.strategies import catalogues, messages

NOW_NS = 1_700_000_000_123_456_789
SPOILED = st.sampled_from([math.nan, math.inf, -math.inf])
DTYPE_OF_TAG = {number: DTYPES[base].newbyteorder("<") for base, number in TAGS.items()}


def spoil(message: Any, draw: Any) -> Any:
    """Put NaN or an infinity into every number and array of floats, some places of it."""
    for field in type(message).__metaros_fields__:
        value = getattr(message, field.attribute)
        if field.type.is_nested:
            for inner in value if field.type.array else [value]:
                spoil(inner, draw)
        elif field.type.base in ("float32", "float64") and draw(st.booleans()):
            if not field.type.array:
                setattr(message, field.attribute, draw(SPOILED))
            elif len(value):
                value = np.array(value)
                value[draw(st.integers(0, len(value) - 1))] = draw(SPOILED)
                setattr(message, field.attribute, value)
    return message


def same(left: Any, right: Any, *, exactly: bool) -> bool:
    """Whether two messages hold the same; not `exactly`: what is not finite is NaN on the right."""
    for field in type(left).__metaros_fields__:
        one, other = getattr(left, field.attribute), getattr(right, field.attribute)
        if field.type.is_nested:
            pairs = zip(one, other, strict=True) if field.type.array else [(one, other)]
            if not all(same(a, b, exactly=exactly) for a, b in pairs):
                return False
        elif field.type.base in ("float32", "float64"):
            one, other = np.array(one), np.array(other)
            if not exactly:
                one = np.where(np.isfinite(one), one, np.nan)
            if not np.array_equal(one, other, equal_nan=True):
                return False
        elif not np.array_equal(np.array(one), np.array(other)):
            return False
    return True


def through_the_wire(message: Any, catalogue: Catalogue) -> Any:
    one = codec("p/msg/M2", catalogue)
    return one.decode(one.encode(message))


def never(text: str) -> None:
    raise AssertionError(f"{text} is no JSON")


@settings(max_examples=50, deadline=None)
@given(catalogues(), st.data())
def test_json_of_any_message_is_json_and_comes_back(catalogue: Catalogue, data: st.DataObject) -> None:
    message = spoil(data.draw(messages("p/msg/M2", catalogue)), data.draw)
    text = json_bytes(json_values(through_the_wire(message, catalogue)))
    assert b"NaN" not in text or b'"' in text  # as a number it would be refused by the next line
    found = json.loads(text, parse_constant=never)
    back = message_of(message_class("p/msg/M2", catalogue), found, now_ns=NOW_NS)
    assert same(message, back, exactly=False)


@settings(max_examples=40, deadline=None)
@given(catalogues(), st.data())
def test_cbor_of_any_message_keeps_every_number(catalogue: Catalogue, data: st.DataObject) -> None:
    def typed(tag: cbor2.CBORTag, _immutable: bool) -> Any:
        return np.frombuffer(tag.value, DTYPE_OF_TAG[tag.tag])

    message = spoil(data.draw(messages("p/msg/M2", catalogue)), data.draw)
    found = cbor2.loads(cbor2.dumps(cbor_values(through_the_wire(message, catalogue))), tag_hook=typed)
    assert same(message, built(message_class("p/msg/M2", catalogue), found), exactly=True)


def built(cls: type[Any], values: dict[str, Any]) -> Any:
    """A message of what CBOR gave."""
    made = {}
    for field in cls.__metaros_fields__:
        value = values[field.name]
        if field.type.is_nested:
            inner = message_class(field.type.base, cls.__metaros_catalogue__)
            value = [built(inner, item) for item in value] if field.type.array else built(inner, value)
        elif field.type.array and isinstance(value, bytes):
            value = np.frombuffer(value, np.uint8)
        made[field.attribute] = value
    return cls(**made)


def test_nan_and_infinities_are_null_in_arrays_too() -> None:
    scan = LaserScan(ranges=[1.5, math.nan, math.inf, -math.inf], angle_min=math.nan)
    found = json.loads(json_bytes(json_values(scan)), parse_constant=never)
    assert (found["ranges"], found["angle_min"]) == ([1.5, None, None, None], None)


def test_bytes_are_base64_out_and_either_way_in() -> None:
    image = CompressedImage(format="jpeg", data=bytes(range(100)))
    found = json.loads(json_bytes(json_values(image)))
    assert found["data"].startswith("AAECAwQF")
    assert message_of(CompressedImage, found, now_ns=NOW_NS).data.tobytes() == bytes(range(100))
    assert message_of(CompressedImage, {"data": [1, 2]}, now_ns=NOW_NS).data.tolist() == [1, 2]
    assert message_of(CompressedImage, {"data": "AQI"}, now_ns=NOW_NS).data.tolist() == [1, 2]
    with pytest.raises(FieldError, match="data"):
        message_of(CompressedImage, {"data": "no base64!"}, now_ns=NOW_NS)


def test_bytes_are_base64_in_however_deep_they_are() -> None:
    catalogue, found = Catalogue(), {"one": {"data": "AQI="}, "more": [{"data": [1]}, {"data": "Aw"}]}
    catalogue.add(MessageDefinition("p/msg/Leaf", (Field("data", FieldType("uint8", "unbounded")),)))
    leaves = (Field("one", FieldType("p/msg/Leaf")), Field("more", FieldType("p/msg/Leaf", "unbounded")))
    catalogue.add(MessageDefinition("p/msg/Tree", leaves))
    tree = message_of(message_class("p/msg/Tree", catalogue), found, now_ns=NOW_NS)
    assert [leaf.data.tolist() for leaf in (tree.one, *tree.more)] == [[1, 2], [1], [3]]


def test_a_stamp_that_is_missing_is_now_and_one_that_is_there_stays() -> None:
    def stamp(value: Any) -> tuple[int, int]:
        found = message_of(BatteryState, value, now_ns=NOW_NS).header.stamp
        return found.sec, found.nanosec

    now = (1_700_000_000, 123_456_789)
    assert stamp({}) == stamp({"header": {}}) == stamp({"header": {"frame_id": "base"}}) == now
    assert stamp({"header": {"stamp": {"sec": 5, "nanosec": 6}}}) == (5, 6)
    assert stamp({"header": {"stamp": {"secs": 5, "nsecs": 6}}}) == (5, 6)  # as pages of ROS 1 write it
    assert message_of(Header, {"frame_id": "map"}, now_ns=NOW_NS).stamp.sec == now[0]


def test_what_does_not_fit_names_its_field() -> None:
    wrong: list[Any] = [{"data": 5}, {"date": "x"}, [], "x", None]
    for value in wrong:
        with pytest.raises(FieldError):
            message_of(String, value, now_ns=NOW_NS)


def test_arguments_may_be_a_list_in_the_order_of_the_fields() -> None:
    assert arguments(Header, None) == {}
    assert arguments(Header, [{"sec": 1}, "map"]) == {"stamp": {"sec": 1}, "frame_id": "map"}
    with pytest.raises(FieldError, match="3 values"):
        arguments(Header, [1, 2, 3])


def test_text_that_is_no_unicode_goes_out_with_a_mark() -> None:
    assert json.loads(json_bytes({"data": ["a\ud800b"]})) == {"data": ["a?b"]}
