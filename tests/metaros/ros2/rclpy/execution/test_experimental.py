"""The executor of events: how it differs from the single-threaded one."""

from __future__ import annotations

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.experimental import EventsExecutor
from metaros.ros2.rclpy.execution.task import Future


def test_it_takes_things_as_they_come_and_a_look_takes_all_of_them(node: Node, rclpy_context: Context) -> None:
    ran = list[str]()
    with EventsExecutor(context=rclpy_context) as executor:
        executor.add_node(node)
        for name in "abc":
            executor.create_task(ran.append, name)
        guard = node.create_guard_condition(lambda: ran.append("guard"))
        guard.trigger()
        executor.spin_once(timeout_sec=0)
        assert ran == ["a"]
        executor.spin_until_future_complete(Future(), 0)
        assert ran == ["a", "b", "c", "guard"]
        done = executor.create_task(ran.append, "d")
        executor.create_task(ran.append, "e")
        executor.spin_until_future_complete(done, 0)
        assert ran[4:] == ["d"]  # the future that was waited for ends it
        node.destroy_guard_condition(guard)
