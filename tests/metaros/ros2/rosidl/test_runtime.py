"""`rosidl_runtime_py`: messages as dicts, YAML and CSV and back, and classes by name."""

from __future__ import annotations

from array import array
from collections import OrderedDict
from pathlib import Path
from typing import Any

import pytest
import yaml

from metaros.idl import Catalogue, message_class, parse_msg
from metaros.idl.catalogue import default_catalogue
from metaros.ros2.rosidl import runtime
from metaros.ros2.rosidl.catalogue import interface
from metaros.ros2.rosidl.parser.definition import BasicType, NamespacedType, UnboundedSequence
from metaros.ros2.rosidl.runtime import utilities
from metaros.ros2.rosidl.runtime.convert import _convert_value


def make(text: str) -> Any:
    catalogue = Catalogue(base=default_catalogue())
    catalogue.add(parse_msg(text, "p/msg/N"))
    return interface("p/msg/N", catalogue)


def example() -> Any:
    cls = make(
        "string text\nbyte octet\nbyte[] octets\nfloat32[] numbers\nint8[2] two\nbool flag\n"
        "std_msgs/String[] many\nstd_msgs/Header header\nstring[<=3] names"
    )
    many = [interface("std_msgs/msg/String")(data=text) for text in ("one", "two")]
    return cls(text="hällo", octet=b"A", octets=[b"a", b"\xff"], numbers=[1.5, 2, 3], many=many, names=["x", "yz"])


def test_as_dict() -> None:
    found = runtime.message_to_ordereddict(example())
    assert found == {
        "text": "hällo",
        "octet": "A",
        "octets": ["a", "ÿ"],
        "numbers": [1.5, 2.0, 3.0],
        "two": [0, 0],
        "flag": False,
        "many": [{"data": "one"}, {"data": "two"}],
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "names": ["x", "yz"],
    }
    assert list(found)[:2] == ["text", "octet"]
    assert type(found["two"][0]) is int
    short = runtime.message_to_ordereddict(example(), truncate_length=2)
    assert (short["text"], short["numbers"], short["two"]) == ("hä...", [1.5, 2.0, "..."], [0, 0])
    assert short["many"] == [{"data": "on..."}, {"data": "tw..."}]
    brief = runtime.message_to_ordereddict(example(), no_arr=True, no_str=True)
    assert brief["text"] == "<string length: <5>>"
    assert [brief[name] for name in ("octets", "two", "many", "names")] == [
        "<sequence type: octet, length: 2>",
        "<array type: int8[2]>",
        "<sequence type: std_msgs/msg/String, length: 2>",
        "<sequence type: string[3], length: 2>",
    ]
    native = message_class("sensor_msgs/msg/Image")(data=b"ab")
    assert runtime.message_to_ordereddict(native)["data"] == [97, 98]


def test_values_alone() -> None:
    assert (_convert_value(True), _convert_value(b"ab", truncate_length=1), _convert_value("ab")) == (
        True,
        "a...",
        "ab",
    )
    assert _convert_value((1, 2, 3), truncate_length=2) == (1, 2, "...")
    assert _convert_value({1: "abc"}, truncate_length=1) == {1: "a..."}
    assert type(_convert_value(OrderedDict(a=1))) is OrderedDict
    assert runtime.message_to_ordereddict(b"\xce\xbb") == {"bytes": b"\xce\xbb"}


def test_as_yaml_and_csv() -> None:
    text = runtime.message_to_yaml(example())
    assert text.startswith("text: hällo\noctet: A\n")
    assert yaml.safe_load(text) == runtime.message_to_ordereddict(example())
    assert runtime.message_to_yaml(interface("std_msgs/msg/Int8")(data=3), flow_style=True) == "{data: 3}\n"
    csv = runtime.message_to_csv(example())
    assert csv == r"hällo,b'A',b'a',b'\xff',1.5,2.0,3.0,0,0,False,one,two,0,0,,x,yz"
    assert runtime.message_to_csv(example(), truncate_length=1).startswith("h...,b'A',b'a',...,1.5,...,0,...,False")
    assert "<sequence type: octet, length: 2>" in runtime.message_to_csv(example(), no_arr=True, no_str=True)
    assert runtime.message_to_csv(b"a") == "b'a'"


def test_setting_fields() -> None:
    message = example()
    values = {
        "text": "new",
        "octet": 7,
        "octets": [1, b"b"],
        "numbers": [4, 5],
        "two": [6, 7],
        "flag": True,
        "many": [{"data": "three"}, interface("std_msgs/msg/String")(data="four")],
        "header": {"frame_id": "map", "stamp": {"sec": 5}},
        "names": ("a",),
    }
    assert runtime.set_message_fields(message, values) == []
    assert (message.text, message.octet, message.octets, message.flag) == ("new", b"\x07", [b"\x01", b"b"], True)
    assert (message.numbers, message.two.tolist(), message.names) == (array("f", [4, 5]), [6, 7], ["a"])
    assert [item.data for item in message.many] == ["three", "four"]
    assert (message.header.frame_id, message.header.stamp.sec) == ("map", 5)
    assert values["many"][0] == {"data": "three"}  # type: ignore[index]
    with pytest.raises(AttributeError):
        runtime.set_message_fields(message, {"nothing": 1})
    with pytest.raises(ValueError, match="text"):
        runtime.set_message_fields(interface("std_msgs/msg/Int8")(), {"data": "text"})
    with pytest.raises(TypeError, match="Value 'auto' is expected to be a dictionary but is a str"):
        runtime.set_message_fields(message, {"header": "auto"})


def test_times_to_be_set_later() -> None:
    message, stamp = example(), interface("builtin_interfaces/msg/Time")(sec=1, nanosec=2)
    header = {"header": {"frame_id": "map", "stamp": "now"}}
    for values in ({"header": "auto"}, header):
        (setter,) = runtime.set_message_fields(message, values, expand_header_auto=True, expand_time_now=True)
        setter(stamp)
        assert message.header.stamp is stamp
        message.header.stamp = interface("builtin_interfaces/msg/Time")()
    assert message.header.frame_id == "map"
    path = interface("nav_msgs/msg/Path")()
    poses = {"header": "auto", "poses": [{"header": "auto"}, {"header": {"stamp": "now"}}]}
    setters = runtime.set_message_fields(path, poses, expand_header_auto=True, expand_time_now=True)
    for setter in setters:
        setter(stamp)
    assert [item.header.stamp.sec for item in (path, *path.poses)] == [1, 1, 1]
    with pytest.raises(TypeError):
        runtime.set_message_fields(message, header)


def test_classes_by_name() -> None:
    string, trigger = interface("std_msgs/msg/String"), interface("std_srvs/srv/Trigger")
    fibonacci = interface("example_interfaces/action/Fibonacci")
    assert utilities.get_message("std_msgs/msg/String") is utilities.get_message("std_msgs/String") is string
    assert utilities.get_service("std_srvs/Trigger") is utilities.get_interface("std_srvs/srv/Trigger") is trigger
    assert utilities.get_action("example_interfaces/Fibonacci") is fibonacci
    kinds = [
        (utilities.is_message(item), utilities.is_service(item), utilities.is_action(item))
        for item in (string, trigger, fibonacci)
    ]
    assert kinds == [(True, False, False), (False, True, False), (False, False, True)]
    with pytest.raises(ValueError, match="Expected the full name of a message, got 'std_srvs/srv/Trigger'"):
        utilities.get_message("std_srvs/srv/Trigger")
    with pytest.raises(ValueError, match="full name"):
        utilities.get_interface("String")
    with pytest.raises(ImportError):
        utilities.get_message("nothing_msgs/msg/String")
    feedback = NamespacedType(["example_interfaces", "action"], "Fibonacci_FeedbackMessage")
    assert runtime.import_message_from_namespaced_type(feedback) is fibonacci.Impl.FeedbackMessage
    with pytest.warns(DeprecationWarning, match="NamespacedType itself"):
        runtime.import_message_from_namespaced_type(UnboundedSequence(feedback))
    slots = runtime.get_message_slot_types(string())
    assert (list(slots), runtime.get_message_slot_types(message_class("std_msgs/msg/Bool")())) == (
        ["data"],
        {"data": BasicType("boolean")},
    )


def test_which_interfaces_there_are(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert runtime.get_interfaces(["std_srvs"]) == {"std_srvs": ["srv/Empty", "srv/SetBool", "srv/Trigger"]}
    assert "srv/Trigger" in runtime.get_service_interfaces()["std_srvs"]
    assert runtime.get_action_interfaces(["example_interfaces", "std_msgs"]) == {
        "example_interfaces": ["action/Fibonacci"]
    }
    assert "std_srvs" not in runtime.get_message_interfaces()
    assert "std_msgs" in runtime.get_interface_packages()
    with pytest.raises(LookupError, match="nothing_msgs"):
        runtime.get_interfaces(["nothing_msgs"])
    with pytest.raises(LookupError):
        runtime.get_interface_path("std_msgs/msg/String")
    monkeypatch.setenv("METAROS_INTERFACE_PATH", str(tmp_path))
    file = tmp_path / "my_msgs" / "msg" / "Own.msg"
    file.parent.mkdir(parents=True)
    file.write_text("int8 a")
    assert (
        runtime.get_interface_path("my_msgs/msg/Own.msg") == runtime.get_interface_path("my_msgs/msg/Own") == str(file)
    )
