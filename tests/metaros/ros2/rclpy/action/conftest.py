"""Nodes with executors for tests of actions, and the classes they use."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.executors import MultiThreadedExecutor
from metaros.ros2.rosidl.catalogue import interface

WAIT_S = 20.0  # for what takes milliseconds on a desk


class Spun:
    """A node whose executor a test turns by hand."""

    def __init__(self, node: Node, executor: Any) -> None:
        self.node, self.executor = node, executor

    def until(self, future: Any) -> Any:
        """Spin until it is done; its result."""
        self.executor.spin_until_future_complete(future, WAIT_S)
        assert future.done()
        return future.result()

    def while_not(self, condition: Callable[[], object], rounds: int = 2000) -> None:
        """Spin until the condition is true."""
        for _ in range(rounds):
            if condition():
                return
            self.executor.spin_once(0.01)
        raise AssertionError("it did not come true")

    def calm(self) -> None:
        """Spin until nothing is left to do."""
        for _ in range(5):
            self.executor.spin_once(0.01)


@pytest.fixture
def spun(rclpy_context: Context) -> Iterator[Spun]:
    """One node and its executor of two threads."""
    node = Node("actor", context=rclpy_context)
    executor = MultiThreadedExecutor(2, context=rclpy_context)
    executor.add_node(node)
    yield Spun(node, executor)
    executor.shutdown()
    node.destroy_node()


@pytest.fixture(scope="session")
def fibonacci() -> Any:
    """The action."""
    return interface("example_interfaces/action/Fibonacci")


@pytest.fixture
def in_background(spun: Spun) -> Iterator[Spun]:
    """The same, spun by a thread."""
    thread = threading.Thread(target=spun.executor.spin)
    thread.start()
    yield spun
    spun.executor.shutdown()
    thread.join()
