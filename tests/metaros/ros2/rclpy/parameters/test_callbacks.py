"""Callbacks before a set, to judge it and after it: when they are called, in which order, with what."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.parameters.parameter import Parameter
from metaros.ros2.rosidl.catalogue import interface


def verdict(reason: str = "") -> Any:
    return interface("rcl_interfaces/msg/SetParametersResult")(successful=not reason, reason=reason)


def noting(notes: list[str], what: str, answer: Callable[[Any], Any]) -> Callable[[Any], Any]:
    def callback(parameters: Any) -> Any:
        notes.append(f"{what} {' '.join(f'{one.name}={one.value}' for one in parameters)}")
        return answer(parameters)

    return callback


def test_order(node: Node) -> None:
    notes: list[str] = []
    node.declare_parameters("", [("a", 0), ("b", 0)])
    for number in (1, 2):
        node.add_pre_set_parameters_callback(noting(notes, f"pre{number}", lambda given: given[:1]))
        node.add_on_set_parameters_callback(noting(notes, f"on{number}", lambda _: verdict()))
        node.add_post_set_parameters_callback(noting(notes, f"post{number}", lambda _: None))
    assert node.set_parameters_atomically([Parameter("a", value=1), Parameter("b", value=1)]).successful
    assert notes == ["pre2 a=1 b=1", "pre1 a=1 b=1", "on2 a=1 a=1", "on1 a=1 a=1", "post2 a=1 a=1", "post1 a=1 a=1"]
    assert node.get_parameter("b").value == 0


def test_declarations_are_judged_too_but_not_changed_before(node: Node) -> None:
    notes: list[str] = []
    node.add_pre_set_parameters_callback(noting(notes, "pre", list))
    node.add_on_set_parameters_callback(noting(notes, "on", lambda _: verdict()))
    node.add_post_set_parameters_callback(noting(notes, "post", lambda _: None))
    node.declare_parameters("", [("a", 1), ("b", 2)])
    node.undeclare_parameter("a")
    assert notes == ["on a=1", "post a=1", "on b=2", "post b=2"]


def test_the_first_refusal_counts(node: Node) -> None:
    notes: list[str] = []
    node.declare_parameter("a", 0)
    node.add_on_set_parameters_callback(noting(notes, "never asked", lambda _: verdict()))
    node.add_on_set_parameters_callback(lambda _: verdict("no"))
    node.add_post_set_parameters_callback(noting(notes, "never told", lambda _: None))
    assert node.set_parameters([Parameter("a", value=1)])[0].reason == "no"
    assert (node.get_parameter("a").value, notes) == (0, [])


def test_a_pre_set_callback_may_add_and_may_leave_nothing(node: Node) -> None:
    node.declare_parameters("", [("a", 0), ("twice", 0)])

    def change(given: Any) -> list[Parameter[Any]]:
        return [*given, Parameter("twice", value=2 * given[0].value)] if given[0].value else []

    node.add_pre_set_parameters_callback(change)
    assert node.set_parameters_atomically([Parameter("a", value=4)]).successful
    assert node.get_parameter("twice").value == 8
    assert node.set_parameters_atomically([Parameter("a", value=0)]).reason.startswith("parameter list cannot be empty")
    node.remove_pre_set_parameters_callback(change)
    assert node.set_parameters_atomically([Parameter("a", value=0)]).successful


def test_callbacks_may_set_parameters(node: Node) -> None:
    node.declare_parameters("", [("a", 0), ("copy", 0)])

    def copy(given: Any) -> None:
        if given[0].name == "a":
            node.set_parameters([Parameter("copy", value=given[0].value)])

    node.add_post_set_parameters_callback(copy)
    node.set_parameters([Parameter("a", value=3)])
    assert node.get_parameter("copy").value == 3


def test_removing_what_is_not_there(node: Node) -> None:
    for remove in (
        node.remove_pre_set_parameters_callback,
        node.remove_on_set_parameters_callback,
        node.remove_post_set_parameters_callback,
    ):
        with pytest.raises(ValueError, match="not in list"):
            remove(list)
