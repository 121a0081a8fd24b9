"""A node to be spun, and an executor that is shut down again."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.executors import MultiThreadedExecutor, SingleThreadedExecutor


@pytest.fixture
def node(rclpy_context: Context) -> Iterator[Node]:
    """In the module's context; it has no timers, and nothing waits."""
    node = Node("spun", context=rclpy_context, start_parameter_services=False, enable_rosout=False)
    yield node
    if rclpy_context.ok():
        node.destroy_node()


@pytest.fixture
def executor(rclpy_context: Context) -> Iterator[SingleThreadedExecutor]:
    """Single-threaded, without nodes."""
    with SingleThreadedExecutor(context=rclpy_context) as executor:
        yield executor


@pytest.fixture
def pool(rclpy_context: Context) -> Iterator[MultiThreadedExecutor]:
    """Of three threads, without nodes."""
    with MultiThreadedExecutor(num_threads=3, context=rclpy_context) as executor:
        yield executor
