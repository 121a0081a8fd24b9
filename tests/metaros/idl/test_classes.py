"""Generated message classes."""

from __future__ import annotations

import copy
import pickle

import numpy as np
import pytest

from metaros.errors import FieldError
from metaros.idl import Catalogue, Message, message_class, parse_msg, type_hash
from tests.support.tables import cases


def make(text: str, name: str = "p/msg/N") -> type:
    catalogue = Catalogue()
    catalogue.add(parse_msg(text, name))
    return message_class(name, catalogue)


def test_identity_and_constants() -> None:
    battery = message_class("sensor_msgs/msg/BatteryState")
    assert battery.__metaros_name__ == "sensor_msgs/msg/BatteryState"
    assert battery.__metaros_hash__ == type_hash("sensor_msgs/msg/BatteryState")
    assert battery.POWER_SUPPLY_STATUS_FULL == 4
    assert message_class("sensor_msgs/msg/BatteryState") is battery
    assert issubclass(battery, Message)


def test_defaults() -> None:
    imu = message_class("sensor_msgs/msg/Imu")()
    assert (imu.header.frame_id, imu.header.stamp.sec) == ("", 0)
    assert (imu.orientation.w, imu.orientation.x) == (1.0, 0.0)
    assert imu.orientation_covariance.dtype == np.float64
    assert imu.orientation_covariance.tolist() == [0.0] * 9
    first, second = message_class("sensor_msgs/msg/Imu")(), message_class("sensor_msgs/msg/Imu")()
    first.orientation_covariance[0] = 1
    assert second.orientation_covariance[0] == 0
    assert first.header is not second.header


def test_defaults_of_the_definition() -> None:
    thing = make('int32 a 7\nstring b "x"\nfloat64[2] c [1, 2]\nstring[] d ["p"]\nbool e true')()
    assert (thing.a, thing.b, thing.c.tolist(), thing.d, thing.e) == (7, "x", [1.0, 2.0], ["p"], True)


def test_fixed_arrays_of_other_things() -> None:
    catalogue = Catalogue()
    catalogue.add(parse_msg("int32 a", "p/msg/Inner"))
    catalogue.add(parse_msg("Inner[2] i\nstring[3] s\nbool[2] b", "p/msg/Outer"))
    outer = message_class("p/msg/Outer", catalogue)()
    assert [item.a for item in outer.i] == [0, 0]
    assert outer.s == ["", "", ""]
    assert outer.b.tolist() == [False, False]


def test_arrays_become_numpy_when_set() -> None:
    image = message_class("sensor_msgs/msg/Image")
    assert image(data=b"ab").data.tolist() == [97, 98]
    assert image(data=[1, 2]).data.dtype == np.uint8
    given = np.arange(3, dtype=np.uint8)
    assert image(data=given).data is given
    scan = message_class("sensor_msgs/msg/LaserScan")(ranges=(1, 2.5))
    assert scan.ranges.dtype == np.float32


@cases("value", [[300], [-1], [1.5], "text", [None], 7, {"a": 1}, np.array([1.5]), np.array([256])])
def test_arrays_that_do_not_fit(value: object) -> None:
    with pytest.raises(FieldError):
        message_class("sensor_msgs/msg/Image")(data=value)


def test_unknown_keywords() -> None:
    with pytest.raises(FieldError, match="no field 'dta'; its fields are: data"):
        message_class("std_msgs/msg/String")(dta="x")
    with pytest.raises(FieldError, match="none"):
        message_class("std_msgs/msg/Empty")(x=1)


def test_unknown_attributes_cannot_be_set() -> None:
    with pytest.raises(AttributeError):
        message_class("std_msgs/msg/String")().dta = "x"


def test_repr() -> None:
    assert repr(message_class("std_msgs/msg/String")(data="x")) == "std_msgs.msg.String(data='x')"
    assert "data=[1, 2]" in repr(message_class("sensor_msgs/msg/Image")(data=[1, 2]))
    assert "data=<uint8[100]>" in repr(message_class("sensor_msgs/msg/Image")(data=bytes(100)))


def test_equality() -> None:
    cls = message_class("sensor_msgs/msg/JointState")
    one, other = cls(name=["a"], position=[1.0]), cls(name=["a"], position=[1.0])
    assert one == other
    other.position = [1.0]
    assert one == other
    other.position = [2.0]
    assert one != other
    assert one != "text"
    with pytest.raises(TypeError):
        hash(one)


def test_field_types_are_spelt_as_in_rclpy() -> None:
    found = message_class("sensor_msgs/msg/Imu").get_fields_and_field_types()
    assert found["header"] == "std_msgs/Header"
    assert found["orientation_covariance"] == "double[9]"
    odd = make("bool a\nbyte b\nstring<=3[<=2] c\nfloat32[] d").get_fields_and_field_types()
    assert odd == {"a": "boolean", "b": "octet", "c": "sequence<string<3>, 2>", "d": "sequence<float>"}


def test_python_keywords_get_an_underscore() -> None:
    cls = make("int32 from\nint32 self\nint32 class")
    thing = cls(from_=1, self=2, class_=3)
    assert (thing.from_, thing.self, thing.class_) == (1, 2, 3)
    assert list(cls.get_fields_and_field_types()) == ["from", "self", "class"]


def test_services_and_actions_are_namespaces() -> None:
    trigger = message_class("std_srvs/srv/Trigger")
    assert trigger.Response(success=True).success is True
    assert trigger.Request is message_class("std_srvs/srv/Trigger_Request")
    assert trigger.Event.__metaros_name__ == "std_srvs/srv/Trigger_Event"
    fibonacci = message_class("example_interfaces/action/Fibonacci")
    assert fibonacci.Goal(order=3).order == 3
    assert fibonacci.Feedback().sequence.dtype == np.int32
    send = message_class("example_interfaces/action/Fibonacci_SendGoal")
    assert send.Request().goal == fibonacci.Goal()
    assert fibonacci.__metaros_hash__ == type_hash("example_interfaces/action/Fibonacci")


def test_copies_and_pickles() -> None:
    scan = message_class("sensor_msgs/msg/LaserScan")(ranges=[1.0, 2.0])
    assert copy.deepcopy(scan) == scan
    assert pickle.loads(pickle.dumps(scan)) == scan
