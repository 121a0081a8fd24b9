"""Print what arrives on /chatter. `--count N` ends after N messages."""

from __future__ import annotations

import argparse

import metaros
from metaros.interfaces.std_msgs.msg import String

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--count", type=int, default=0, help="how many messages; 0 means for ever")
count = parser.parse_args().count

with metaros.Node("listener") as node:
    heard = 0

    @node.subscription(String, "chatter", qos=10)
    def on_message(message: String, info: metaros.MessageInfo) -> None:
        global heard
        heard += 1
        node.get_logger().info(f"I heard: {message.data} (number {info.seq})")
        if heard == count:
            node.close()

    metaros.spin(node)
