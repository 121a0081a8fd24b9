"""Levels of loggers over the wire."""

from __future__ import annotations

from typing import Any

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.logging import loggers
from metaros.ros2.rclpy.logging.severity import LoggingSeverity
from metaros.ros2.rosidl.catalogue import interface


def test_levels_of_any_logger_are_set_and_read(rclpy_context: Context) -> None:
    level, executor = interface("rcl_interfaces/msg/LoggerLevel"), SingleThreadedExecutor(context=rclpy_context)

    def call(kind: str, **fields: Any) -> Any:
        service = interface(f"rcl_interfaces/srv/{kind}LoggerLevels")
        client = node.create_client(service, f"/ns/server/{kind.lower()}_logger_levels")
        assert client.wait_for_service(10)
        future = client.call_async(service.Request(**fields))
        executor.spin_until_future_complete(future, 10)
        return future.result()

    with Node("server", namespace="/ns", context=rclpy_context, enable_logger_service=True) as node:
        executor.add_node(node)
        wanted = [level(name="rcl", level=10), level(name="rclpy", level=22), level(name="ns.server", level=40)]
        results = call("Set", levels=wanted).results
        names = ["rcl", "rclpy", "ns.server", "nobody"]
        found = [(item.name, item.level) for item in call("Get", names=names).levels]
        assert node.get_logger().get_effective_level() is LoggingSeverity.ERROR
    executor.shutdown()
    assert [(result.successful, bool(result.reason)) for result in results] == [
        (True, False),
        (False, True),
        (True, False),
    ]
    assert results[1].reason == "Failed reason: Invalid logger level."
    assert found == [("rcl", 10), ("rclpy", 0), ("ns.server", 40), ("nobody", 0)]
    assert loggers.get_logger_level("rcl") is LoggingSeverity.DEBUG
