"""What programs do with rosidl's classes: construct, read, compare, copy, and ask them about themselves."""

from __future__ import annotations

import copy
import pickle
from array import array
from typing import Any

import numpy as np
import pytest

from metaros.cdr import codec
from metaros.idl import Catalogue, message_class, parse_definition
from metaros.idl.catalogue import default_catalogue
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.rosidl.parser.definition import (
    Array,
    BasicType,
    BoundedSequence,
    BoundedString,
    NamespacedType,
    UnboundedSequence,
    UnboundedString,
    UnboundedWString,
)


def make(text: str, name: str = "p/msg/N") -> Any:
    catalogue = Catalogue(base=default_catalogue())
    catalogue.add(parse_definition(text, name))
    return interface(name, catalogue)


def string(data: str = "") -> Any:
    return interface("std_msgs/msg/String")(data=data)


def test_names_and_reprs() -> None:
    assert repr(string("x")) == "std_msgs.msg.String(data='x')"
    image = interface("sensor_msgs/msg/Image")
    assert repr(image(data=[1, 2])).endswith("step=0, data=[1, 2])")
    assert repr(interface("std_msgs/msg/Empty")()) == "std_msgs.msg.Empty()"
    places = {
        "std_msgs/msg/String": "std_msgs.msg._string.String",
        "std_msgs/msg/UInt8MultiArray": "std_msgs.msg._u_int8_multi_array.UInt8MultiArray",
        "sensor_msgs/msg/PointCloud2": "sensor_msgs.msg._point_cloud2.PointCloud2",
        "tf2_msgs/msg/TFMessage": "tf2_msgs.msg._tf_message.TFMessage",
        "std_srvs/srv/SetBool_Request": "std_srvs.srv._set_bool.SetBool_Request",
        "example_interfaces/action/Fibonacci_GetResult_Response": (
            "example_interfaces.action._fibonacci.Fibonacci_GetResult_Response"
        ),
    }
    assert {name: f"{interface(name).__module__}.{interface(name).__name__}" for name in places} == places


def test_what_fields_hold() -> None:
    cls = make(
        "bool a\nbyte b\nchar c\nfloat32 d\nint64 e\nwstring f\nbool[] g\nbyte[2] h\nchar[] i\nfloat32[<=4] j\n"
        "uint16[3] k\nstring[2] l\nstd_msgs/String m\nstd_msgs/String[2] n\nbyte[] o\nbool[3] p"
    )
    for message in (cls(), codec(cls).decode(codec(cls).encode(cls()))):
        assert (message.a, message.b, message.c, message.d, message.e, message.f) == (False, b"\0", 0, 0.0, 0, "")
        assert (message.g, message.h, message.o, message.p) == ([], [b"\0", b"\0"], [], [False] * 3)
        assert (message.i, message.j) == (array("B"), array("f"))
        assert (type(message.i), message.j.typecode) == (array, "f")
        assert (message.k.dtype, message.k.tolist()) == (np.uint16, [0, 0, 0])
        assert (message.l, message.m, message.n) == (["", ""], string(), [string(), string()])
        message.k[0], message.k[2] = 7, 9  # what was received is writable, too
        message.i.append(3)
        message.g.append(True)
        assert (message.k.tolist(), message.i, message.g) == ([7, 0, 9], array("B", [3]), [True])
        assert codec(cls).decode(codec(cls).encode(message)) == message


def test_sequences_become_arrays_when_set() -> None:
    scan = interface("sensor_msgs/msg/LaserScan")()
    for value in ([1.0, 2.5], (1, 2.5), array("f", [1, 2.5]), np.array([1, 2.5]), np.array([1, 2.5], np.float32)):
        scan.ranges = value
        assert (type(scan.ranges), scan.ranges.typecode, scan.ranges.tolist()) == (array, "f", [1.0, 2.5])
    image = interface("sensor_msgs/msg/Image")
    given = array("B", b"abc")
    message = image(data=given)
    given[0] = 0
    assert message.data.tobytes() == b"abc" == image(data=b"abc").data.tobytes()
    message.data = given
    assert message.data is given
    info = interface("sensor_msgs/msg/CameraInfo")(k=range(9))
    assert (info.k.dtype, info.k[8]) == (np.float64, 8.0)
    with pytest.raises(AssertionError, match="'k' takes 9 numbers"):
        interface("sensor_msgs/msg/CameraInfo")(k=[1.0])
    with pytest.raises(OverflowError):
        image(data=[300])


def test_received_arrays_are_converted_once() -> None:
    cls = interface("sensor_msgs/msg/Image")
    received = codec(cls).decode(codec(cls).encode(cls(data=bytes(100_000))))
    assert received.data is received.data is received._data
    received.data[5] = 1
    assert codec(cls).decode(codec(cls).encode(received)).data[5] == 1


def test_keywords_of_the_constructor() -> None:
    with pytest.raises(AssertionError, match="constructor: dta; std_msgs/String has: data"):
        interface("std_msgs/msg/String")(dta="x")
    with pytest.raises(TypeError):
        interface("std_msgs/msg/String")("x")
    with pytest.raises(AttributeError):
        string().dta = "x"
    odd = make("int32 from\nint32 self\nstring check_fields\nint32 property")
    thing = odd(**{"from": 1, "self": 2, "check_fields": "yes", "property": 3})
    assert (getattr(thing, "from"), thing.from_, thing.self, thing.check_fields, thing.property) == (1, 1, 2, "yes", 3)
    setattr(thing, "from", 5)
    assert (thing.from_, list(odd.get_fields_and_field_types())) == (5, ["from", "self", "check_fields", "property"])
    assert codec(odd).decode(codec(odd).encode(thing)) == thing


def test_constants_and_defaults_cannot_be_overwritten() -> None:
    cls = make(
        'byte OCTET=50\nint32 LOW=-3\nint32 a 7\nint32[] b [1, 2]\nstring[2] c ["x", "y"]\nbyte d 9\nuint8[2] e [1, 2]'
    )
    assert (cls.OCTET, cls.LOW, cls().LOW) == (b"2", -3, -3)
    assert (7, array("i", [1, 2]), ["x", "y"], b"\t") == (
        cls.A__DEFAULT,
        cls.B__DEFAULT,
        cls.C__DEFAULT,
        cls.D__DEFAULT,
    )
    assert cls.E__DEFAULT.tolist() == [1, 2]
    for name in ("OCTET", "LOW", "A__DEFAULT", "B__DEFAULT"):
        with pytest.raises(AttributeError, match=name):
            setattr(cls, name, 1)
        with pytest.raises(AttributeError, match=name):
            delattr(cls, name)
    with pytest.raises(AttributeError):
        cls().LOW = 1
    first, second = cls(), cls()
    first.b.append(3)
    first.c[0] = "z"
    assert (second.b, second.c, second.a, second.d) == (array("i", [1, 2]), ["x", "y"], 7, b"\t")


def test_equality() -> None:
    cls = interface("sensor_msgs/msg/JointState")
    one, other = cls(name=["a"], position=[1.0]), cls(name=["a"], position=[1.0])
    assert one == other == codec(cls).decode(codec(cls).encode(one))
    other.position[0] = 2.0
    assert one != other
    assert (one == "text", one.__eq__("text"), string("x") == string("y")) == (False, False, False)
    with pytest.raises(TypeError):
        hash(one)
    nan = interface("std_msgs/msg/Float64")(data=float("nan"))
    assert nan == nan


def test_copies_and_pickles() -> None:
    image = interface("sensor_msgs/msg/Image")(data=b"abc", width=3)
    received = codec(type(image)).decode(codec(type(image)).encode(image))
    for message in (image, received):
        deep, shallow = copy.deepcopy(message), copy.copy(message)
        assert deep == shallow == message == pickle.loads(pickle.dumps(message))
        assert (shallow.header is message.header, deep.header is message.header) == (True, False)
        deep.data[0] = 0
        assert message.data[0] == 97
    checked = interface("std_msgs/msg/String")(data="x", check_fields=True)
    for again in (copy.copy(checked), copy.deepcopy(checked), pickle.loads(pickle.dumps(checked))):
        with pytest.raises(AssertionError):
            again.data = 3
    own = Own(data="x")
    own.more = [1]
    for again in (copy.copy(own), copy.deepcopy(own), pickle.loads(pickle.dumps(own))):
        assert (type(again), again.data, again.more) == (Own, "x", [1])


class Own(interface("std_msgs/msg/String")):  # type: ignore[misc]
    """A program's own subclass of a message."""


def test_what_classes_say_of_themselves() -> None:
    cls = interface("sensor_msgs/msg/Image")
    assert cls.__slots__ == [*(f"_{name}" for name in cls.get_fields_and_field_types()), "_check_fields"]
    assert cls()._check_fields is False
    assert {slot: getattr(cls(), slot) for slot in cls.__slots__}["_encoding"] == ""
    assert cls.get_fields_and_field_types()["header"] == "std_msgs/Header"
    assert cls.get_fields_and_field_types()["data"] == "sequence<uint8>"
    texts = cls.get_fields_and_field_types()
    texts["more"] = "text"
    assert "more" not in cls.get_fields_and_field_types()
    event = interface("std_srvs/srv/Trigger_Event").get_fields_and_field_types()
    assert event["request"] == "sequence<std_srvs/Trigger_Request, 1>"
    odd = make("bool a\nbyte b\nstring<=3[<=2] c\nfloat32[] d\nwstring e\nstd_msgs/String[3] f\nchar g\nstring h")
    assert (
        odd().SLOT_TYPES
        == odd.SLOT_TYPES
        == (
            BasicType("boolean"),
            BasicType("octet"),
            BoundedSequence(BoundedString(3), 2),
            UnboundedSequence(BasicType("float")),
            UnboundedWString(),
            Array(NamespacedType(["std_msgs", "msg"], "String"), 3),
            BasicType("uint8"),
            UnboundedString(),
        )
    )


def test_services_and_actions() -> None:
    trigger = interface("std_srvs/srv/Trigger")
    assert trigger.Request is interface("std_srvs/srv/Trigger_Request")
    assert trigger.Event(response=[trigger.Response(message="x")]).response[0].message == "x"
    fibonacci = make("int32 order\n---\nint32[] all\n---\nint32[] some", "p/action/Fibonacci")
    assert fibonacci.Goal(order=3).order == 3
    send = fibonacci.Impl.SendGoalService
    assert (send.__name__, send.Request().goal, fibonacci.Impl.FeedbackMessage().feedback) == (
        "Fibonacci_SendGoal",
        fibonacci.Goal(),
        fibonacci.Feedback(),
    )
    for kind in (trigger, fibonacci):
        with pytest.raises(NotImplementedError, match="made of parts"):
            kind()


def test_type_support_as_programs_ask_for_it() -> None:
    for name in ("std_msgs/msg/String", "std_srvs/srv/Trigger", "example_interfaces/action/Fibonacci"):
        cls = make("string data", "p/msg/Fresh") if name.startswith("std_msgs") else interface(name)
        meta: Any = type(cls)
        assert meta.__name__ == f"Metaclass_{cls.__name__}"
        meta.__import_type_support__()
        assert (cls.__metaros_name__, cls.__metaros_hash__) == meta._TYPE_SUPPORT
    fresh: Any = type(make("string data", "p/msg/Another"))
    assert fresh._TYPE_SUPPORT is None


def test_annotated_classes_have_a_twin() -> None:
    native = message_class("std_msgs/msg/String")
    assert native(data="x") != string("x")
    assert string("x") != native(data="x")
