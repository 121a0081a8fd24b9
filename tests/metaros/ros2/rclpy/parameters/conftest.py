"""Nodes of rclpy's shape for tests of their parameters."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node

__all__ = ["MakeNode"]

MakeNode = Callable[..., Node]


@pytest.fixture
def make_node(rclpy_context: Context) -> Iterator[MakeNode]:
    """Make nodes that the test's end destroys."""
    nodes: list[Node] = []

    def make(name: str = "base", **options: Any) -> Node:
        nodes.append(Node(name, context=rclpy_context, **options))
        return nodes[-1]

    yield make
    for node in nodes:
        node.destroy_node()


@pytest.fixture
def node(make_node: MakeNode) -> Node:
    """A node whose parameters have to be declared."""
    return make_node()
