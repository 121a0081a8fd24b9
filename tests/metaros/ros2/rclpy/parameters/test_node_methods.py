"""What a node does with its parameters: declaring, reading, setting, describing, with rclpy's errors."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from metaros.errors import ParameterError
from metaros.limits import LIMITS
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.names.exceptions import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from metaros.ros2.rclpy.parameters.parameter import Parameter
from metaros.ros2.rosidl.catalogue import interface
from tests.metaros.ros2.rclpy.parameters.conftest import MakeNode
from tests.support.tables import cases

Type = Parameter.Type
OWN = {"use_sim_time": False, "start_type_description_service": True}  # what every node has


def descriptor(**fields: Any) -> Any:
    return interface("rcl_interfaces/msg/ParameterDescriptor")(**fields)


def value_message(**fields: Any) -> Any:
    return interface("rcl_interfaces/msg/ParameterValue")(**fields)


# -- declaring ---------------------------------------------------------------------------------------------------------


def test_every_form_of_a_declaration(node: Node) -> None:
    node.declare_parameter("plain", 1)
    node.declare_parameter("described", 0.5, descriptor(description="half"))
    node.declare_parameter("message", value_message(type=4, string_value="text"))
    node.declare_parameter("any", None, descriptor(dynamic_typing=True))
    declared = node.declare_parameters("group", [("a", True), ("b", [1]), ("c", "x", descriptor(read_only=True))])
    assert [(one.name, one.value) for one in declared] == [("group.a", True), ("group.b", [1]), ("group.c", "x")]
    assert node.get_parameter("message").value == "text"
    assert node.get_parameter("any").type_ is Type.NOT_SET
    assert node.declare_parameter("typed", Type.DOUBLE).value is None
    assert node.describe_parameter("typed").type == Type.DOUBLE.value
    found = node.describe_parameter("described")
    assert (found.name, found.type, found.description) == ("described", Type.DOUBLE.value, "half")
    assert node.has_parameter("group.a")
    assert not node.has_parameter("a")


def test_a_name_alone_is_deprecated(node: Node) -> None:
    with pytest.warns(UserWarning, match="when declaring parameter 'bare'") as warned:
        node.declare_parameters("", [("bare",)])
    with pytest.warns(UserWarning, match="'bare_too'") as warned_too:
        assert node.declare_parameter("bare_too").value is None
    assert node.describe_parameter("bare").dynamic_typing
    assert [one.filename for one in (*warned, *warned_too)] == [__file__] * 2


def test_overrides_win_unless_they_are_ignored(make_node: MakeNode, tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("/**: {ros__parameters: {from_file: 1, over: file, both: file}}")
    given = [Parameter("from_program", value=[1]), Parameter("both", value="program")]
    arguments = ["-p", "over:=command", "--params-file", str(file), "-p", "late:=2.5", "-p", "raw:=!!binary YQ=="]
    node = make_node(cli_args=arguments, parameter_overrides=given)
    declared = node.declare_parameters(
        "", [("from_file", 0), ("from_program", [0]), ("over", ""), ("both", ""), ("late", 0.0), ("raw", [b"b"])]
    )
    assert [one.value for one in declared] == [1, [1], "file", "program", 2.5, [b"a"]]
    node.undeclare_parameter("late")
    assert node.declare_parameter("late", 0.0, ignore_override=True).value == 0.0
    node.undeclare_parameter("late")
    wrong = r"'late' to '2\.5' of type 'DOUBLE', expecting type 'STRING'"
    with pytest.raises(InvalidParameterTypeException, match=wrong):
        node.declare_parameter("late", "text")


def test_overrides_are_declared_by_themselves_where_that_is_asked(make_node: MakeNode) -> None:
    node = make_node(
        cli_args=["-p", "a:=1", "-p", "b:=[0.5, 1]", "-p", "use_sim_time:=false", "-p", "none:="],
        automatically_declare_parameters_from_overrides=True,
    )
    found = {name: one.value for name, one in node.get_parameters_by_prefix("").items()}
    assert found == OWN | {"a": 1, "b": [0.5, 1.0]}


def test_overrides_that_are_no_values(make_node: MakeNode) -> None:
    with pytest.raises(ParameterError, match="the value given to parameter a: "):
        make_node(cli_args=["-p", "a:={b: 1}"])


@cases(
    ("parts", "error", "text"),
    [
        ((), TypeError, "has 0 parts"),
        (("a", 1, descriptor(), 1), TypeError, "has 4 parts"),
        ((1, 1), TypeError, "its name must be a str"),
        (("", 1), InvalidParameterException, "Invalid parameter name"),
        (("a", 1, value_message()), TypeError, "must be a ParameterDescriptor"),
        (("a", value_message(), descriptor()), ValueError, "without a type"),
        (("a", None, descriptor()), ValueError, "without a type"),
        (("a", Type.NOT_SET), ValueError, "with the type NOT_SET"),
        (("a", Type.BOOL, descriptor(dynamic_typing=True)), ValueError, "may not ask for dynamic_typing"),
        (("a", {}), TypeError, "is no parameter value"),
        (("a", 7, descriptor(integer_range=[interface("rcl_interfaces/msg/IntegerRange")(to_value=6)])),
         InvalidParameterValueException, "out of range: 7 is not within 0..6"),
        (("use_sim_time", True), ParameterAlreadyDeclaredException, "use_sim_time"),
    ],
)  # fmt: skip
def test_declarations_that_are_refused(node: Node, parts: Any, error: type[Exception], text: str) -> None:
    with pytest.raises(error, match=text):
        node.declare_parameters("", [parts])
    assert not node.has_parameter("a")


def test_what_was_declared_before_a_refused_one_stays(node: Node) -> None:
    refuse = interface("rcl_interfaces/msg/SetParametersResult")
    node.add_on_set_parameters_callback(lambda given: refuse(successful=given[0].name != "b", reason="not b"))
    with pytest.raises(InvalidParameterValueException, match="Reason: not b"):
        node.declare_parameters("", [("a", 1), ("b", 2), ("c", 3)])
    assert [node.has_parameter(name) for name in "abc"] == [True, False, False]


def test_undeclaring(node: Node) -> None:
    node.declare_parameters("", [("a", 1), ("fixed", 1, descriptor(read_only=True))])
    node.undeclare_parameter("a")
    with pytest.raises(ParameterNotDeclaredException):
        node.undeclare_parameter("a")
    with pytest.raises(ParameterImmutableException):
        node.undeclare_parameter("fixed")
    node.declare_parameter("a", "again")


# -- reading -----------------------------------------------------------------------------------------------------------


def test_reading(node: Node) -> None:
    node.declare_parameters("", [("a.x", 1), ("a.y", 0.5), ("ab", True), ("unset", Type.STRING)])
    assert node.get_parameter("a.x") is node.get_parameters(["a.x"])[0]
    assert node.get_parameters_by_prefix("a") == {"x": node.get_parameter("a.x"), "y": node.get_parameter("a.y")}
    assert node.get_parameters_by_prefix("b") == {}
    assert node.get_parameter_types(["a.x", "ab", "unset"]) == [2, 1, 0]
    other = Parameter("other", value=1)
    assert node.get_parameter_or("none", other) is node.get_parameter_or("unset", other) is other
    assert node.get_parameter_or("a.x", other).value == 1
    assert node.get_parameter_or("none").type_ is Type.NOT_SET
    with pytest.raises(ParameterUninitializedException):
        node.get_parameter("unset")
    for ask in (node.get_parameter, node.get_parameter_type, node.describe_parameter):
        with pytest.raises(ParameterNotDeclaredException, match="none"):
            ask("none")
    ask_all: Any
    for ask_all in (node.get_parameters, node.get_parameter_types):
        with pytest.raises(TypeError, match="1 is no name"):
            ask_all([1])


def test_listing(node: Node) -> None:
    node.declare_parameters("", [("a", 1), ("b.c", 1), ("b.d.e", 1)])

    def names(prefixes: list[str], depth: int) -> list[str]:
        return list(node.list_parameters(prefixes, depth).names)

    assert names([], 0) == [*OWN, "a", "b.c", "b.d.e"]
    assert names([], 1) == [*OWN, "a"]
    assert names(["b"], 0) == ["b.c", "b.d.e"]
    assert names(["b"], 1) == ["b.c"]
    assert names(["a", "b.d"], 1) == ["a", "b.d.e"]
    assert node.list_parameters(["b"], 0).prefixes == ["b", "b.d"]
    wrong: Any
    for wrong in (("b", 0), (["b"], "0"), ([1], 0)):
        with pytest.raises(TypeError):
            node.list_parameters(*wrong)
    with pytest.raises(ValueError, match="negative"):
        node.list_parameters([], -1)


# -- setting -----------------------------------------------------------------------------------------------------------


def test_each_for_itself_or_all_or_none(node: Node) -> None:
    node.declare_parameters("", [("a", 1), ("b", 1), ("fixed", 1, descriptor(read_only=True))])

    def three(value: int) -> list[Parameter[Any]]:
        return [Parameter("a", value=value), Parameter("fixed", value=value), Parameter("b", value=value)]

    assert [result.successful for result in node.set_parameters(three(2))] == [True, False, True]
    refused = node.set_parameters_atomically(three(3))
    assert (refused.successful, refused.reason) == (False, "Trying to set a read-only parameter: fixed.")
    with pytest.raises(ParameterNotDeclaredException, match=r"\['none'\]"):
        node.set_parameters([Parameter("a", value=4), Parameter("none", value=4), Parameter("b", value=4)])
    assert [node.get_parameter(name).value for name in ("a", "fixed", "b")] == [4, 1, 2]
    with pytest.raises(TypeError, match="no parameter"):
        node.set_parameters([42])  # type: ignore[list-item]  # as programs do it


def test_types_stay_unless_typing_is_dynamic(node: Node) -> None:
    node.declare_parameters("", [("static", 1), ("typed", Type.INTEGER), ("free", 1, descriptor(dynamic_typing=True))])

    def reason(name: str, value: Any) -> str:
        return str(node.set_parameters([Parameter(name, value=value)])[0].reason)

    assert reason("static", "x") == "Wrong parameter type, expected 'Type.INTEGER' got 'Type.STRING'"
    assert reason("static", None) == reason("typed", None) == "Static parameter cannot be undeclared"
    assert reason("typed", 3) == ""
    assert reason("free", "x") == ""
    assert node.describe_parameter("free").type == Type.STRING.value
    assert reason("free", None) == ""
    assert not node.has_parameter("free")


def test_undeclared_parameters_where_they_are_allowed(make_node: MakeNode) -> None:
    node = make_node(allow_undeclared_parameters=True)
    assert node.get_parameter("new").value is None
    assert node.get_parameter_type("new") is Type.NOT_SET
    assert node.describe_parameter("new") == descriptor()
    assert node.set_descriptor("new", descriptor()) == value_message()
    assert node.set_parameters([Parameter("new", value=1)])[0].successful
    assert node.set_parameters([Parameter("new", value="x")])[0].successful
    assert node.describe_parameter("new") == descriptor(name="new", type=4, dynamic_typing=True)
    with pytest.raises(ParameterAlreadyDeclaredException):
        node.declare_parameter("new", 1)


def test_a_node_takes_only_so_many(make_node: MakeNode) -> None:
    node = make_node(allow_undeclared_parameters=True)
    many = [Parameter(f"p{number}", value=number) for number in range(LIMITS.parameters_per_node - len(OWN) + 1)]
    result = node.set_parameters_atomically(many)
    assert result.reason == f"a node takes {LIMITS.parameters_per_node} parameters"
    assert node.set_parameters_atomically(many[1:]).successful


def test_descriptors_can_be_replaced(node: Node) -> None:
    node.declare_parameter("a", 5)
    bounds = interface("rcl_interfaces/msg/IntegerRange")(from_value=0, to_value=4)
    with pytest.raises(InvalidParameterValueException, match="out of range"):
        node.set_descriptor("a", descriptor(type=2, integer_range=[bounds]))
    kept = node.set_descriptor("a", descriptor(type=2, integer_range=[bounds]), value_message(type=2, integer_value=3))
    assert kept.integer_value == node.get_parameter("a").value == 3
    node.set_descriptor("a", descriptor(type=2, read_only=True))
    assert node.describe_parameter("a").name == "a"
    with pytest.raises(ParameterImmutableException):
        node.set_descriptor("a", descriptor())
    with pytest.raises(ParameterNotDeclaredException):
        node.set_descriptor("none", descriptor())
