"""Which actions nodes have, as rclpy tells it; and remapped names."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy.action import (
    ActionClient,
    ActionServer,
    get_action_client_names_and_types_by_node,
    get_action_names_and_types,
    get_action_server_names_and_types_by_node,
)
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.core.rcl_errors import NodeNameNonExistentError

TYPES = ["example_interfaces/action/Fibonacci"]


@pytest.fixture
def nodes(rclpy_context: Context) -> Iterator[list[Node]]:
    """Three, each in a namespace of its own."""
    made = [Node(f"n{number}", namespace=f"/s{number}", context=rclpy_context) for number in range(3)]
    yield made
    for node in made:
        node.destroy_node()


def test_who_has_which_actions(nodes: list[Node], fibonacci: Any) -> None:
    ActionClient(nodes[1], fibonacci, "a")
    ActionServer(nodes[1], fibonacci, "a", lambda goal_handle: None)
    for name in ("a", "b"):
        ActionClient(nodes[2], fibonacci, name)
    ActionServer(nodes[2], fibonacci, "a", lambda goal_handle: None)
    found = {
        what.__name__: [sorted(what(nodes[0], f"n{number}", f"/s{number}")) for number in range(3)]
        for what in (get_action_client_names_and_types_by_node, get_action_server_names_and_types_by_node)
    }
    assert found == {
        "get_action_client_names_and_types_by_node": [[], [("/s1/a", TYPES)], [("/s2/a", TYPES), ("/s2/b", TYPES)]],
        "get_action_server_names_and_types_by_node": [[], [("/s1/a", TYPES)], [("/s2/a", TYPES)]],
    }
    assert sorted(get_action_names_and_types(nodes[0])) == [(name, TYPES) for name in ("/s1/a", "/s2/a", "/s2/b")]
    with pytest.raises(NodeNameNonExistentError):
        get_action_server_names_and_types_by_node(nodes[0], "nobody", "/")


def test_an_action_is_renamed_as_a_whole_or_by_its_parts(rclpy_context: Context, fibonacci: Any) -> None:
    rules = ["--ros-args", "-r", "a:=/moved", "-r", "b/_action/feedback:=/told"]
    node = Node("renamed", context=rclpy_context, cli_args=rules)
    try:
        ActionServer(node, fibonacci, "a", lambda goal_handle: None)
        ActionServer(node, fibonacci, "b", lambda goal_handle: None)
        names = get_action_server_names_and_types_by_node(node, "renamed", "/")
        assert names == [("/moved", TYPES)]
        assert node.count_publishers("/told") == 1
    finally:
        node.destroy_node()
