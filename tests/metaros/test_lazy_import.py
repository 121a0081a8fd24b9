"""A light node starts without the modules that only others need: they are most of a cold start."""

from __future__ import annotations

import subprocess
import sys

from metaros.lazy_import import LazyModule

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
heavy = ("numpy", "asyncio", "yaml", "sortedcontainers", "random", "subprocess", "metaros.node.action")
print([name for name in heavy if name in sys.modules])
"""


def test_a_light_node_loads_nothing_heavy() -> None:
    done = subprocess.run([sys.executable, "-c", LIGHT], capture_output=True, text=True, check=False)
    assert (done.stdout.strip(), done.stderr) == ("[]", "")


def test_a_module_is_imported_with_its_first_attribute() -> None:
    later = LazyModule("fractions")
    assert "when needed" in repr(later)
    assert later.Fraction(1, 2) == 0.5
    assert "Fraction" in vars(later)
