"""Publish a counter on /chatter, twice a second. `--count N` ends after N messages."""

from __future__ import annotations

import argparse

import metaros
from metaros.interfaces.std_msgs.msg import String

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--count", type=int, default=0, help="how many messages; 0 means for ever")
count = parser.parse_args().count

with metaros.Node("talker") as node:
    publisher = node.create_publisher(String, "chatter", 10)
    sent = 0

    @node.timer(0.5)
    def tick() -> None:
        global sent
        sent += 1
        publisher.publish(String(data=f"Hello World: {sent}"))
        node.get_logger().info(f"Publishing: Hello World: {sent}")
        if sent == count:
            node.close()

    metaros.spin(node)
