"""The codec's behaviour: views, byte order, what it accepts, and errors that name the field."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest

from metaros.cdr import codec
from metaros.errors import DecodeError, DefinitionError, FieldError, UnknownTypeError
from metaros.idl import Catalogue, default_catalogue, message_class, parse_msg, type_hash
from tests.support.tables import cases

LITTLE = b"\0\1\0\0"


def learnt(text: str, **others: str) -> Catalogue:
    catalogue = Catalogue(base=default_catalogue())
    for name, other in others.items():
        catalogue.add(parse_msg(other, f"p/msg/{name}"))
    catalogue.add(parse_msg(text, "p/msg/N"))
    return catalogue


def test_a_codec_is_made_once() -> None:
    cls = message_class("std_msgs/msg/String")
    assert codec("std_msgs/msg/String") is codec(cls)
    assert codec(cls).name == "std_msgs/msg/String"
    assert codec(cls).hash == type_hash("std_msgs/msg/String")
    assert repr(codec(cls)) == "Codec('std_msgs/msg/String')"


def test_a_class_brings_its_catalogue() -> None:
    catalogue = learnt("int32 a")
    cls = message_class("p/msg/N", catalogue)
    assert type(codec(cls).decode(codec(cls).encode(cls(a=3)))) is cls


def test_unknown_types() -> None:
    with pytest.raises(UnknownTypeError):
        codec("p/msg/Nope")
    with pytest.raises(UnknownTypeError, match="parts"):
        codec("std_srvs/srv/Trigger")


def test_services_and_actions() -> None:
    response = message_class("std_srvs/srv/Trigger").Response(success=True, message="ok")
    assert codec("std_srvs/srv/Trigger_Response").decode(codec(type(response)).encode(response)) == response
    goal = message_class("example_interfaces/action/Fibonacci_SendGoal_Request")()
    goal.goal.order = 5
    assert codec(type(goal)).decode(codec(type(goal)).encode(goal)).goal.order == 5


def test_empty_messages_are_one_byte() -> None:
    empty = message_class("std_msgs/msg/Empty")()
    assert codec(type(empty)).encode(empty) == LITTLE + b"\0"
    assert codec(type(empty)).decode(LITTLE + b"\0") == empty
    with pytest.raises(DecodeError):
        codec(type(empty)).decode(LITTLE)


def test_arrays_are_views_of_the_bytes_where_they_are_aligned() -> None:
    image = codec("sensor_msgs/msg/Image")
    data = image.encode(message_class("sensor_msgs/msg/Image")(data=bytes(range(256)) * 1000))
    found = image.decode(data).data
    assert not found.flags.writeable
    assert not found.flags.owndata
    assert np.shares_memory(found, np.frombuffer(data, np.uint8))
    scan = codec("sensor_msgs/msg/LaserScan")
    data = scan.encode(message_class("sensor_msgs/msg/LaserScan")(ranges=[1.0, 2.0]))
    assert np.shares_memory(scan.decode(data).ranges, np.frombuffer(data, np.uint8))


@cases("count", [1, 3, 20_000])
@cases("frame", ["", "a", "ab", "abc", "abcd"])
@cases("shift", [0, 1, 4])
def test_arrays_are_always_aligned(count: int, frame: str, shift: int) -> None:
    cls = message_class("sensor_msgs/msg/JointState")
    message = cls(name=[frame], position=np.arange(count, dtype=float), effort=np.arange(count, dtype=float))
    data = codec(cls).encode(message)
    padded = bytes(shift) + data
    for given in (data, memoryview(padded)[shift:]):
        found = codec(cls).decode(given)
        assert found == message
        assert found.position.flags.aligned
        assert found.effort.flags.aligned


def test_large_fixed_arrays_lie_where_the_standard_says() -> None:
    """Those over 512 bytes are no part of a run of small fields, in the encoder and in the decoder."""
    catalogue = learnt("int8 a\nfloat64[65] b\nint8 c\nbool[513] d\nint32 e")
    cls = message_class("p/msg/N", catalogue)
    numbers, flags = [n / 2 for n in range(65)], [n % 3 == 0 for n in range(513)]
    little, big = (
        head + b"\5" + bytes(7) + struct.pack(f"{order}65d", *numbers) + b"\6" + bytes(flags) + bytes(2) + last
        for head, order, last in ((LITTLE, "<", b"\7\0\0\0"), (b"\0\0\0\0", ">", b"\0\0\0\7"))
    )
    good = {"a": 5, "b": numbers, "c": 6, "d": flags, "e": 7}
    assert codec(cls).encode(cls(**good)) == little
    for data in (little, big):
        found = codec(cls).decode(data)
        assert (found.a, found.b.tolist(), found.c, found.d.tolist(), found.e) == (5, numbers, 6, flags, 7)
        with pytest.raises(DecodeError):
            codec(cls).decode(data[:-1])
    for name, values in (("b", numbers[1:]), ("d", [*flags, True])):
        wrong = cls(**good)
        setattr(wrong, name, values)
        with pytest.raises(FieldError, match=f"{name}: {len(values)} elements, exactly"):
            codec(cls).encode(wrong)


def test_big_endian_is_accepted() -> None:
    data = struct.pack(">4xiII4sx3x", 1, 2, 5, b"base")[:-3]
    header = codec("std_msgs/msg/Header").decode(data)
    assert (header.stamp.sec, header.stamp.nanosec, header.frame_id) == (1, 2, "base")
    floats = codec("std_msgs/msg/Float64MultiArray")
    body = struct.pack(">IIIxxxx2d", 0, 0, 2, 1.5, 2.5)
    assert floats.decode(b"\0\0\0\0" + body).data.tolist() == [1.5, 2.5]


@cases("padding", [0, 1, 2, 3])
def test_up_to_three_bytes_of_padding_are_tolerated(padding: int) -> None:
    text = codec("std_msgs/msg/String")
    data = text.encode(message_class("std_msgs/msg/String")(data="abc"))
    assert text.decode(data + bytes(padding)).data == "abc"


def test_more_bytes_are_not() -> None:
    with pytest.raises(DecodeError, match="std_msgs/msg/Bool: 4 bytes too many"):
        codec("std_msgs/msg/Bool").decode(LITTLE + b"\1" + bytes(4))


@cases(
    ("data", "complaint"),
    [
        (b"", "the header alone"),
        (b"\0\1", "the header alone"),
        (b"\0\2\0\0" + bytes(8), "not plain CDR"),
        (b"\1\1\0\0" + bytes(8), "not plain CDR"),
        (LITTLE, "data: 4 bytes needed at offset 0, 0 are left"),
        (LITTLE + b"\5\0\0\0abc", "data: 5 bytes needed at offset 4, 3 are left"),
        (LITTLE + b"\4\0\0\0abcd", "data: a string that does not end with NUL"),
        (LITTLE + b"\xff\xff\xff\xffabcd", "data: 4294967295 bytes needed"),
        (LITTLE + b"\xff\xff\xff\x7fabcd", "data: 2147483647 bytes needed"),
        ("text", "CDR is bytes, not str"),
    ],
)
def test_malformed_strings(data: Any, complaint: str) -> None:
    with pytest.raises(DecodeError, match=complaint):
        codec("std_msgs/msg/String").decode(data)


def test_a_string_of_length_zero_is_empty() -> None:
    assert codec("std_msgs/msg/String").decode(LITTLE + bytes(4)).data == ""


def test_text_that_is_not_utf8_is_replaced() -> None:
    data = LITTLE + struct.pack("<I5s", 5, b"a\xb0Cx\0")
    assert codec("std_msgs/msg/String").decode(data).data == "a\ufffdCx"
    assert codec("std_msgs/msg/String").decode(memoryview(data)).data == "a\ufffdCx"


@cases("name", ["sensor_msgs/msg/LaserScan", "nav_msgs/msg/Path", "sensor_msgs/msg/JointState"])
def test_huge_sequence_lengths_allocate_nothing(name: str) -> None:
    data = codec(name).encode(message_class(name)())
    for position in range(4, len(data) - 3, 4):
        for length in (0x7FFFFFFF, 0xFFFFFFFF):
            damaged = bytearray(data)
            damaged[position : position + 4] = struct.pack("<I", length)
            try:
                codec(name).decode(bytes(damaged))
            except DecodeError as error:
                assert name in str(error)  # noqa: PT017


def test_the_path_of_what_is_malformed() -> None:
    cls = message_class("tf2_msgs/msg/TFMessage")
    stamped = message_class("geometry_msgs/msg/TransformStamped")
    data = codec(cls).encode(cls(transforms=[stamped(), stamped()]))
    with pytest.raises(DecodeError, match=r"transforms\[1\]\.transform\.rotation\.w: 8 bytes needed"):
        codec(cls).decode(data[:-1])


def test_bounds_are_checked_when_decoding() -> None:
    free, bound = (
        learnt("string a\nint32[] b\nstring[] c\nwstring d"),
        learnt("string<=2 a\nint32[<=2] b\nstring[<=1] c\nwstring<=1 d"),
    )
    good = {"a": "xy", "b": [1, 2], "c": ["z"], "d": "w"}
    cls = message_class("p/msg/N", free)
    assert codec("p/msg/N", bound).decode(codec(cls).encode(cls(**good))).a == "xy"
    for name, value in {"a": "xyz", "b": [1, 2, 3], "c": ["", ""], "d": "ww"}.items():
        data = codec(cls).encode(cls(**(good | {name: value})))
        with pytest.raises(DecodeError, match=rf"p/msg/N: {name}: .* at most"):
            codec("p/msg/N", bound).decode(data)


def test_booleans_other_than_one() -> None:
    catalogue = learnt("bool a\nbool[2] b\nbool[] c")
    data = LITTLE + b"\2\0\7" + b"\0" + struct.pack("<I", 2) + b"\0\3"
    found = codec("p/msg/N", catalogue).decode(data)
    assert (found.a, found.b.tolist(), found.c.tolist()) == (True, [False, True], [False, True])
    assert found.b.dtype == np.bool_


@cases(
    ("name", "values", "complaint"),
    [
        ("std_msgs/msg/String", {"data": 5}, "data: expected a str, got int"),
        ("std_msgs/msg/String", {"data": None}, "data: expected a str, got NoneType"),
        ("std_msgs/msg/String", {"data": b"x"}, "data: expected a str, got bytes"),
        ("std_msgs/msg/String", {"data": "\ud800"}, "data: text that cannot be encoded"),
        ("std_msgs/msg/UInt8", {"data": 256}, r"data: 256 does not fit uint8 \(0 to 255\)"),
        ("std_msgs/msg/Int64", {"data": 2**63}, "does not fit int64"),
        ("std_msgs/msg/Int64", {"data": 1.0}, "data: expected a int64, got float"),
        ("std_msgs/msg/Float64", {"data": "1"}, "data: expected a float64, got str"),
        ("std_msgs/msg/Float32", {"data": 1e39}, "data: 1e[+]39 does not fit float32"),
        ("sensor_msgs/msg/JointState", {"name": "abc"}, "name: expected a list, got str"),
        ("sensor_msgs/msg/JointState", {"name": ["a", 1]}, r"name\[1\]: expected a str"),
        ("std_msgs/msg/Header", {"stamp": None}, r"stamp\.sec: expected a builtin_interfaces/msg/Time, got NoneType"),
        ("nav_msgs/msg/Path", {"poses": [1]}, r"poses\[0\]\.header: expected a geometry_msgs/msg/PoseStamped, got int"),
        ("nav_msgs/msg/Path", {"poses": None}, "poses: expected a list"),
    ],
)
def test_values_that_do_not_fit_name_their_path(name: str, values: dict[str, Any], complaint: str) -> None:
    message = message_class(name)()
    for field, value in values.items():
        setattr(message, field, value)
    with pytest.raises(FieldError, match=complaint):
        codec(name).encode(message)


def test_arrays_set_to_something_else_after_construction() -> None:
    imu = message_class("sensor_msgs/msg/Imu")()
    imu.orientation_covariance = [1.0] * 9
    assert codec(type(imu)).decode(codec(type(imu)).encode(imu)).orientation_covariance.tolist() == [1.0] * 9
    imu.orientation_covariance = np.ones((3, 3), dtype=np.float32)
    assert codec(type(imu)).decode(codec(type(imu)).encode(imu)).orientation_covariance.tolist() == [1.0] * 9
    imu.orientation_covariance = [1.0] * 8
    with pytest.raises(FieldError, match="orientation_covariance: 8 elements, exactly 9"):
        codec(type(imu)).encode(imu)
    scan = message_class("sensor_msgs/msg/LaserScan")()
    scan.ranges = np.arange(10, dtype=np.float32)[::2]
    assert codec(type(scan)).decode(codec(type(scan)).encode(scan)).ranges.tolist() == [0.0, 2.0, 4.0, 6.0, 8.0]
    scan.ranges = ["a"]
    with pytest.raises(FieldError, match="ranges: no array of float32"):
        codec(type(scan)).encode(scan)


def test_bounds_are_checked_when_encoding() -> None:
    catalogue = learnt(
        "string<=2 a\nint32[<=2] b\nstring[<=1] c\nstring[1] d\nwstring<=1 e\nInner[<=1] f", Inner="int8 a"
    )
    cls = message_class("p/msg/N", catalogue)
    inner = message_class("p/msg/Inner", catalogue)
    bad: dict[str, Any] = {"a": "xyz", "b": [1, 2, 3], "c": ["", ""], "d": [], "e": "ww", "f": [inner(), inner()]}
    for name, value in bad.items():
        with pytest.raises(FieldError, match=rf"{name}: "):
            codec(cls).encode(cls(**{name: value}))


def test_not_a_number_and_infinity() -> None:
    cls = message_class("geometry_msgs/msg/Point32")
    found = codec(cls).decode(codec(cls).encode(cls(x=math.inf, y=-math.inf, z=math.nan)))
    assert (found.x, found.y) == (math.inf, -math.inf)
    assert math.isnan(found.z)


def test_wide_strings_outside_the_basic_plane() -> None:
    cls = message_class("example_interfaces/msg/WString")
    data = codec(cls).encode(cls(data="aé😀"))
    assert len(data) == 4 + 4 + 4 * 4
    assert codec(cls).decode(data).data == "aé😀"


def test_a_type_that_would_explode_is_refused() -> None:
    catalogue = Catalogue()
    catalogue.add(parse_msg("int32 a", "p/msg/M0"))
    for level in range(1, 30):
        catalogue.add(parse_msg(f"M{level - 1} a\nM{level - 1} b", f"p/msg/M{level}"))
    with pytest.raises(DefinitionError, match="more than"):
        codec("p/msg/M29", catalogue)


@cases("mark", ["", "[]"])
def test_a_type_that_is_too_deep_is_refused(mark: str) -> None:
    catalogue = Catalogue()
    catalogue.add(parse_msg("int32 a", "p/msg/M0"))
    for level in range(1, 60):
        catalogue.add(parse_msg(f"M{level - 1}{mark} a", f"p/msg/M{level}"))
    with pytest.raises(DefinitionError):
        codec("p/msg/M59", catalogue)


def test_python_keywords_as_field_names() -> None:
    catalogue = learnt("int32 from\nint32[] class\nstring if")
    cls = message_class("p/msg/N", catalogue)
    message = cls(from_=1, class_=[2], if_="x")
    assert codec(cls).decode(codec(cls).encode(message)) == message
