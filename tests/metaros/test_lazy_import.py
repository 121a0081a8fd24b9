"""A light node starts without the modules that only others need: they are most of a cold start."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from metaros.lazy_import import LazyModule

HEAVY = (
    *("numpy", "asyncio", "yaml", "sortedcontainers", "random", "subprocess", "shutil", "pathlib", "urllib.parse"),
    *("metaros.node.action", "metaros.ros2.rclpy.action", "metaros.ros2.rclpy.lifecycle", "metaros.ros2.rosidl.parser"),
)
LIGHT = """
import sys
import metaros
from metaros.interfaces.std_msgs.msg import String

with metaros.Context(connect=[]) as context, metaros.Node("light", context=context) as node:
    publisher = node.create_publisher(String, "chatter")
    heard = node.create_subscription(String, "chatter", lambda message: None)
    node.create_timer(60.0, lambda: None)
    publisher.publish(String(data="x"))
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    executor.spin_once(timeout_s=0)
"""
LIGHT_FOR_RCLPY = """
import sys
import metaros.ros2
metaros.ros2.install()
import rclpy
from std_msgs.msg import String

rclpy.init()
node = rclpy.create_node("light")
heard = []
node.create_subscription(String, "chatter", heard.append, 10)
node.create_timer(60.0, lambda: None)
node.create_publisher(String, "chatter", 10).publish(String(data="x"))
while not heard:
    rclpy.spin_once(node)
rclpy.shutdown()
"""


@pytest.mark.parametrize("program", [LIGHT, LIGHT_FOR_RCLPY], ids=["native", "rclpy"])
def test_a_light_node_loads_nothing_heavy(program: str) -> None:
    environ = {**os.environ, "METAROS_ZENOH_PORT": "1"}  # where nobody listens
    program += f"print([name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False, env=environ)
    assert (done.stdout.strip(), done.stderr) == ("[]", "")


def test_a_module_is_imported_with_its_first_attribute() -> None:
    later = LazyModule("fractions")
    assert "when needed" in repr(later)
    assert later.Fraction(1, 2) == 0.5
    assert "Fraction" in vars(later)
