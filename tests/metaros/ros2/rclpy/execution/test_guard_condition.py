"""Guard conditions."""

from __future__ import annotations

import pytest

from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.core.rcl_errors import InvalidHandle
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor


def test_it_runs_once_however_often_it_was_triggered(node: Node, executor: SingleThreadedExecutor) -> None:
    calls = list[str]()
    executor.add_node(node)
    guard = node.create_guard_condition(lambda: calls.append("called"))
    executor.spin_once(timeout_sec=0)
    assert calls == []
    for _ in range(3):
        guard.trigger()
    for _ in range(2):
        executor.spin_once(timeout_sec=0)
    assert calls == ["called"]
    guard.trigger()
    assert node.destroy_guard_condition(guard)
    assert not node.destroy_guard_condition(guard)
    executor.spin_once(timeout_sec=0)
    assert calls == ["called"]
    with pytest.raises(InvalidHandle):
        guard.trigger()
