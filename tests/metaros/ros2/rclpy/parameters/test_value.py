"""Parameters, their types, and their way to messages and back."""

from __future__ import annotations

import array
import pickle
from typing import Any

import pytest

from metaros.ros2.rclpy.parameters.parameter import Parameter, get_parameter_value, parameter_value_to_python
from metaros.ros2.rosidl.catalogue import interface
from tests.support.tables import cases

Type = Parameter.Type


@cases(
    ("value", "expected"),
    [
        (None, "NOT_SET"),
        (True, "BOOL"),
        (1, "INTEGER"),
        (1.0, "DOUBLE"),
        ("", "STRING"),
        ([b"a", b"b"], "BYTE_ARRAY"),
        ([], "BYTE_ARRAY"),
        ([True], "BOOL_ARRAY"),
        ((1, 2), "INTEGER_ARRAY"),
        ([1, True], "INTEGER_ARRAY"),
        (array.array("i", [1]), "INTEGER_ARRAY"),
        (array.array("d", [1]), "DOUBLE_ARRAY"),
        ([0.5], "DOUBLE_ARRAY"),
        (["a"], "STRING_ARRAY"),
        ([1, 0.5], "TypeError"),
        ([1, "a"], "TypeError"),
        ({"a": 1}, "TypeError"),
        (b"ab", "TypeError"),
        (1j, "TypeError"),
    ],
)
def test_the_type_of_a_value(value: Any, expected: str) -> None:
    try:
        found = Type.from_parameter_value(value)
    except TypeError:
        assert expected == "TypeError"
    else:
        assert found.name == expected
        assert found.check(value)


@cases(
    ("kind", "value", "taken"),
    [
        (Type.DOUBLE, 1, False),
        (Type.INTEGER, True, True),
        (Type.BOOL, 1, False),
        (Type.BYTE_ARRAY, [b"ab"], False),
        (Type.BYTE_ARRAY, array.array("B"), False),
        (Type.STRING_ARRAY, [], True),
        (Type.STRING_ARRAY, "ab", False),
        (Type.NOT_SET, 0, False),
    ],
)
def test_what_a_type_takes(kind: Type, value: Any, taken: bool) -> None:
    assert kind.check(value) is taken


def test_type_and_value_have_to_agree() -> None:
    with pytest.raises(ValueError, match=r"'speed': the value 1 is not of type DOUBLE"):
        Parameter("speed", Type.DOUBLE, 1)
    with pytest.raises(TypeError, match=r"must be one of Parameter\.Type, not 'double'"):
        Parameter("speed", "double", 1.0)  # type: ignore[arg-type]  # as programs do it
    with pytest.raises(TypeError, match="is no parameter value"):
        Parameter("speed", value={})


@cases("value", [None, True, -(2**63), 0.5, "täxt", [b"a", b"\xff"], [True, False], [1, 2], [0.5], ["a", ""]])
def test_messages_and_back(value: Any) -> None:
    message = Parameter("a.b", value=value).to_parameter_msg()
    assert isinstance(message, interface("rcl_interfaces/msg/Parameter"))
    again = Parameter.from_parameter_msg(message)
    assert (again.name, again.type_) == ("a.b", Type.from_parameter_value(value))
    assert parameter_value_to_python(message.value) == value


def test_a_type_that_no_release_knows() -> None:
    with pytest.raises(RuntimeError, match="42 is no type"):
        parameter_value_to_python(interface("rcl_interfaces/msg/ParameterValue")(type=42))


@cases(
    ("text", "kind", "value"),
    [
        ("true", "BOOL", True),
        ("42", "INTEGER", 42),
        ("3.5", "DOUBLE", 3.5),
        ("foo", "STRING", "foo"),
        ("'42'", "STRING", "42"),
        ("", "STRING", ""),
        (" ", "STRING", " "),
        ("null", "STRING", "null"),
        ("[]", "BOOL_ARRAY", []),
        ("[1, 2]", "INTEGER_ARRAY", [1, 2]),
        ("[1.0]", "DOUBLE_ARRAY", [1.0]),
        ("[a, b]", "STRING_ARRAY", ["a", "b"]),
        ("[1, a]", "STRING", "[1, a]"),
        ("{a: 1}", "STRING", "{a: 1}"),
        ("[1, ", "STRING", "[1, "),
        ("2026-01-01", "STRING", "2026-01-01"),
    ],
)
def test_what_people_type(text: str, kind: str, value: Any) -> None:
    message = get_parameter_value(text)
    assert (Type(message.type).name, parameter_value_to_python(message)) == (kind, value)


def test_types_can_be_named_indexed_and_pickled() -> None:
    assert str(Type.INTEGER_ARRAY) == "Type.INTEGER_ARRAY"
    assert pickle.loads(pickle.dumps(Type.DOUBLE)) is Type.DOUBLE
    assert Parameter[int] is not None
    assert repr(Parameter("a", value=1)) == "Parameter('a', Type.INTEGER, 1)"
