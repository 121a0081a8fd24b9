"""The parser of .msg, .srv and .action text."""

from __future__ import annotations

import pytest

from metaros.errors import DefinitionError
from metaros.idl import Constant, Field, FieldType, MessageDefinition, parse_action, parse_msg, parse_srv
from tests.support.tables import cases

NAME = "a_msgs/msg/Thing"


def fields(text: str) -> tuple[Field, ...]:
    return parse_msg(text, NAME).fields


@cases(
    ("text", "expected"),
    [
        ("int32 x", FieldType("int32")),
        ("char x", FieldType("char")),
        ("wstring x", FieldType("wstring")),
        ("float64[9] x", FieldType("float64", "fixed", 9)),
        ("uint8[] x", FieldType("uint8", "unbounded")),
        ("uint8[<=5] x", FieldType("uint8", "bounded", 5)),
        ("string<=10 x", FieldType("string", string_bound=10)),
        ("string<=10[<=5] x", FieldType("string", "bounded", 5, 10)),
        ("string<=10[5] x", FieldType("string", "fixed", 5, 10)),
        ("wstring<=3[] x", FieldType("wstring", "unbounded", 0, 3)),
        ("Other x", FieldType("a_msgs/msg/Other")),
        ("std_msgs/Header x", FieldType("std_msgs/msg/Header")),
        ("std_msgs/msg/Header[2] x", FieldType("std_msgs/msg/Header", "fixed", 2)),
        ("a_msgs/srv/Do_Request x", FieldType("a_msgs/srv/Do_Request")),
        ("time x", FieldType("builtin_interfaces/msg/Time")),
        ("duration x", FieldType("builtin_interfaces/msg/Duration")),
    ],
)
def test_field_types(text: str, expected: FieldType) -> None:
    assert fields(text) == (Field("x", expected),)
    assert fields(f"{expected.text()} x") == (Field("x", expected),)


@cases(
    ("text", "default"),
    [
        ("int32 x 5", 5),
        ("int32 x -5", -5),
        ("uint8 x 0xff", 255),
        ("int16 x 007", 7),
        ("float32 x 1e3", 1000.0),
        ("float64 x -.5", -0.5),
        ("bool x true", True),
        ("bool x 0", False),
        ('string x "a # b"', "a # b"),
        ("string x 'it'", "it"),
        (r'string x "a\"b\n"', 'a"b\n'),
        ("string x bare words", "bare words"),
        ("int32[] x []", []),
        ("int32[3] x [1, 2, 3]", [1, 2, 3]),
        ("float64[<=3] x [1.5]", [1.5]),
        ('string[] x ["a", "b, c", \'d\']', ["a", "b, c", "d"]),
        ("bool[2] x [true, 0]", [True, False]),
    ],
)
def test_defaults(text: str, default: object) -> None:
    (field,) = fields(text)
    assert field.default == default
    assert type(field.default) is type(default)


@cases(
    ("text", "value"),
    [
        ("int32 X=5", 5),
        ("int32 X = 5 # five", 5),
        ("float64 X= 2", 2.0),
        ("bool X=True", True),
        ('string X="a=b # c"', "a=b # c"),
        ("string X=a b", "a b"),
        ("string X=''", ""),
        ("string<=3 X=abc", "abc"),
        ("byte X=255", 255),
    ],
)
def test_constants(text: str, value: object) -> None:
    definition = parse_msg(text, NAME)
    assert definition.fields == ()
    (constant,) = definition.constants
    assert (constant.name, constant.value) == ("X", value)


def test_comments_blank_lines_and_windows_line_ends() -> None:
    text = "# head\r\n\r\nint32 a # it's a number\r\n  float64[] b # don't\r\n"
    assert [field.name for field in fields(text)] == ["a", "b"]


def test_an_empty_message() -> None:
    assert parse_msg("# nothing\n", NAME) == MessageDefinition(NAME)


def test_a_service() -> None:
    service = parse_srv("int8 MODE=1\nint64 a\n---\nint64 sum\n", "a_msgs/srv/Add")
    assert service.request.name == "a_msgs/srv/Add_Request"
    assert service.request.constants == (Constant("MODE", FieldType("int8"), 1),)
    assert service.response.fields == (Field("sum", FieldType("int64")),)


def test_an_action() -> None:
    action = parse_action("int32 order\n---\n---\nOther[] seen", "a_msgs/action/Go")
    assert (action.goal.name, action.result.fields) == ("a_msgs/action/Go_Goal", ())
    assert action.feedback.fields[0].type.base == "a_msgs/msg/Other"


@cases(
    ("text", "complaint"),
    [
        ("int32", "expected `type name`"),
        ("int32 9x", "no field name"),
        ("int32 camelCase", "no field name"),
        ("int32 two__parts", "no field name"),
        ("int32 trailing_", "no field name"),
        ("int33 x", "neither a primitive type"),
        ("lower/x/Y z", "neither a primitive type"),
        ("a/b/c/d x", "is no type"),
        ("int32[-1] x", "is no type"),
        ("int32[0] x", "size must be between"),
        ("int32[99999999999] x", "size must be between"),
        ("int32[<=] x", "bound of the sequence is missing"),
        ("int32<=3 x", "only a string"),
        ("string<=0 x", "at least 1"),
        ("int32 lower=3", "no constant name"),
        ("Other X=3", "must be of a primitive type"),
        ("int32[] X=3", "must be of a primitive type"),
        ("int32 X=", "is no int32"),
        ("uint8 X=256", "does not fit uint8"),
        ("uint8 x -1", "does not fit uint8"),
        ("int32 x 1.5", "is no int32"),
        ("float32 x 1e39", "does not fit float32"),
        ("float64 x abc", "is no float64"),
        ("bool x yes", "is no bool"),
        ("Other x 3", "cannot have a default"),
        ("int32[2] x [1]", "the default has 1 elements"),
        ("int32[<=2] x [1, 2, 3]", "at most 2"),
        ("int32[2] x 1", "looks like"),
        ('string<=2 x "abc"', "at most 2"),
        ('string x "abc', "no closing quote"),
        ("int32 x\nint64 x", "defined twice"),
        ("int32 a\n\nint33 x", "line 3"),
        ("int32 a\n---\nint32 b", "`---`"),
    ],
)
def test_bad_text_names_the_interface_and_the_line(text: str, complaint: str) -> None:
    with pytest.raises(DefinitionError, match=complaint) as caught:
        parse_msg(text, NAME)
    assert NAME in str(caught.value)


@cases("name", ["", "String", "std_msgs/String", "Std/msg/String", "a/msg/b/c", "a/srv"])
def test_bad_names(name: str) -> None:
    with pytest.raises(DefinitionError):
        parse_msg("int32 a", name)


def test_services_and_actions_need_their_parts() -> None:
    with pytest.raises(DefinitionError, match="2 parts"):
        parse_srv("int32 a", "a_msgs/srv/Add")
    with pytest.raises(DefinitionError, match="too many"):
        parse_srv("---\n---\n", "a_msgs/srv/Add")
    with pytest.raises(DefinitionError, match="3 parts"):
        parse_action("---\n", "a_msgs/action/Go")
    with pytest.raises(DefinitionError, match="no name of a srv"):
        parse_srv("---\n", "a_msgs/msg/Add")


def test_a_huge_text_is_refused() -> None:
    with pytest.raises(DefinitionError, match="1000000"):
        parse_msg("#" * 1_000_001, NAME)
