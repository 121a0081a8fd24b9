"""Every shipped type as rosidl's class, its bytes those of the native class; and which catalogue a class is of."""

from __future__ import annotations

import json
import random  # noqa: TID251 - seeded
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from metaros.cdr import Codec, codec
from metaros.cdr.decoder import build_fast_decoder
from metaros.cdr.encoder import build_encoder
from metaros.errors import DecodeError, UnknownTypeError
from metaros.idl import Action, Catalogue, Message, Service, message_class, parse_msg, remember, type_hash
from metaros.idl.arrays import DTYPES
from metaros.idl.catalogue import default_catalogue, shipped_names
from metaros.idl.definitions import FieldType, MessageDefinition
from metaros.idl.derived import derived_definitions
from metaros.node.action.types import ActionTypes
from metaros.ros2.rosidl.catalogue import interface, rosidl_catalogue

DATA = Path(__file__).parents[3] / "data"
REAL: dict[str, list[str]] = json.loads((DATA / "ros2_vectors.json").read_text())["real_ros2_jazzy_cdr"]["vectors"]
HASHES: dict[str, str] = json.loads((DATA / "ros2_rihs01.json").read_text())["distros"]["jazzy"]["hashes"]


def never(_: Any) -> Any:
    raise AssertionError("good input was handed to the slow codec")


def message_names() -> list[str]:
    names: set[str] = set()
    for name in shipped_names():
        definition = default_catalogue().get(name)
        parts = (definition, *derived_definitions(definition).values())
        names.update(part.name for part in parts if isinstance(part, MessageDefinition))
    return sorted(names)


def filled(name: str) -> Any:
    """A native message whose fields differ from each other and from their defaults."""
    message = message_class(name)()
    for number, field in enumerate(type(message).__metaros_fields__, start=1):
        kind = field.type
        count = kind.capacity if kind.array == "fixed" else min(kind.capacity or 3, 3)
        if kind.base in DTYPES and kind.array:
            value: Any = (np.arange(count) % 2 + (0 if kind.base == "bool" else number)).astype(DTYPES[kind.base])
        else:
            value = [single(kind, number + index) for index in range(count)] if kind.array else single(kind, number)
        setattr(message, field.attribute, value)
    return message


def single(kind: FieldType, number: int) -> Any:
    if kind.is_nested:
        return filled(kind.base)
    if kind.is_string:
        return "é" * (number % 5)
    return {"bool": bool(number % 2), "float32": number / 2, "float64": number / 4}.get(kind.base, number)


def test_every_shipped_type_has_the_native_bytes() -> None:
    shaped, wrong = rosidl_catalogue(), []
    names = message_names()
    for name in names:
        texts = [codec(name).encode(filled(name)), *(bytes.fromhex(text) for text in REAL.get(name, ()))]
        encode, decode = build_encoder(name, shaped, never), build_fast_decoder(name, shaped, never)
        for data in texts:
            message = decode(data)
            same = type(message) is interface(name) and encode(message) == data == codec(type(message)).encode(message)
            read = {field: getattr(message, field) for field in message.get_fields_and_field_types()}  # converts
            again = type(message)(**read)
            if not (same and again == message and encode(message) == encode(again) == data):
                wrong.append(name)
    assert not wrong
    assert len(names) > 330


def test_damaged_bytes_are_told_in_the_same_words() -> None:
    dice, wrong = random.Random(3), []
    for name in message_names():
        good = codec(name).encode(filled(name))
        for _ in range(4):
            data = bytearray(good[: dice.randrange(len(good) + 1)] if dice.random() < 0.5 else good)
            for _ in range(dice.randrange(3) if data else 0):
                data[dice.randrange(len(data))] = dice.randrange(256)
            if outcome(codec(name), bytes(data)) != outcome(codec(interface(name)), bytes(data)):
                wrong.append(f"{name}: {data.hex()}")
    assert not wrong


def outcome(code: Codec, data: bytes) -> bytes | str:
    try:
        return code.encode(code.decode(data))
    except DecodeError as error:
        return str(error)


def test_hashes_are_those_of_ros2() -> None:
    wrong = [name for name in shipped_names() if interface(name).__metaros_hash__ != HASHES.get(name, type_hash(name))]
    assert not wrong
    assert interface("std_msgs/msg/String").__metaros_hash__ == HASHES["std_msgs/msg/String"]


def test_both_byte_orders_and_the_slow_codec() -> None:
    cls = interface("sensor_msgs/msg/JointState")
    message = cls(name=["a"], position=[1.5, 2.5], velocity=np.array([3.0]))
    little = codec(cls).encode(message)
    assert codec(cls).decode(bytearray(little)) == message
    big = b"\0\0" + little[2:4] + build_big_endian(little)
    assert codec(cls).decode(big) == message
    assert type(codec(cls).decode(big)) is cls


def build_big_endian(little: bytes) -> bytes:
    """The body of that JointState with its 32-bit and 64-bit words turned round."""
    body, out, sizes = little[4:], b"", [4, 4, 4, -4, 4, 4, -4, 4, 8, 8, 4, -4, 8, 4]
    for size in sizes:
        out, body = out + (body[:size][::-1] if size > 0 else body[:-size]), body[abs(size) :]
    return out


def test_classes_are_one_a_type_and_found_from_parts() -> None:
    shaped = rosidl_catalogue()
    image = interface("sensor_msgs/msg/Image")
    assert interface("sensor_msgs/msg/Image") is image is message_class("sensor_msgs/msg/Image", shaped)
    assert image is not message_class("sensor_msgs/msg/Image")
    assert type(image().header) is interface("std_msgs/msg/Header")
    assert image.__metaros_catalogue__ is shaped is rosidl_catalogue(shaped)
    assert shaped.home("std_msgs/msg/String") is shaped
    assert (issubclass(image, Message), issubclass(interface("std_srvs/srv/Trigger"), Service)) == (True, True)
    with pytest.raises(UnknownTypeError):
        interface("std_msgs/msg/Nothing")


def test_all_parts_of_an_action_have_the_shape() -> None:
    fibonacci: Any = interface("example_interfaces/action/Fibonacci")
    assert Action in fibonacci.__mro__
    types = ActionTypes(fibonacci)
    assert types.send_goal is fibonacci.Impl.SendGoalService
    assert types.cancel_goal is fibonacci.Impl.CancelGoalService is interface("action_msgs/srv/CancelGoal")
    assert types.feedback is fibonacci.Impl.FeedbackMessage
    assert types.status is fibonacci.Impl.GoalStatusMessage
    request = types.send_goal.Request(goal_id=types.goal_id(bytes(range(16))), goal=fibonacci.Goal(order=3))
    assert build_encoder(request.__metaros_name__, rosidl_catalogue(), never)(request)[4:20] == bytes(range(16))


def test_types_of_other_catalogues() -> None:
    own = Catalogue(base=default_catalogue())
    own.add(parse_msg("std_msgs/Header header\nuint8[] data", "rosidl_test/msg/Own"))
    cls = interface("rosidl_test/msg/Own", own)
    assert cls is interface("rosidl_test/msg/Own", own)
    assert type(cls().header) is interface("std_msgs/msg/Header")
    assert codec(cls).decode(codec(cls).encode(cls(data=b"ab"))).data.tolist() == [97, 98]
    assert remember("rosidl_test/msg/Own", cls.__metaros_catalogue__) == cls.__metaros_hash__
    rosidl_catalogue(own).add(parse_msg("Own own", "rosidl_test/msg/Second"))
    assert "rosidl_test/msg/Second" in own


def test_native_messages_within_are_taken() -> None:
    twist = interface("geometry_msgs/msg/TwistWithCovariance")()
    native = message_class("geometry_msgs/msg/TwistWithCovariance")(covariance=[float(item) for item in range(36)])
    stamped = interface("geometry_msgs/msg/TwistWithCovarianceStamped")(twist=native)
    assert codec(type(stamped)).decode(codec(type(stamped)).encode(stamped)).twist.covariance[35] == 35.0
    assert codec(type(native)).encode(twist) == codec(type(twist)).encode(twist)
    status = interface("diagnostic_msgs/msg/DiagnosticStatus")
    assert codec("diagnostic_msgs/msg/DiagnosticStatus").encode(status(level=status.STALE))[4] == 3
    assert codec(status).encode(status(level=3))[4] == 3
