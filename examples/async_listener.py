"""An async callback: the node stays responsive while one awaits. `--count N` ends after N messages."""

from __future__ import annotations

import argparse
import asyncio

import metaros
from metaros.interfaces.std_msgs.msg import String

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--count", type=int, default=0, help="how many messages; 0 means for ever")
count = parser.parse_args().count

with metaros.Node("async_listener") as node:
    heard = 0

    @node.subscription(String, "chatter")
    async def on_message(message: String) -> None:
        global heard
        await asyncio.sleep(0.1)  # a web request, a database, another robot's service: timers run meanwhile
        heard += 1
        node.get_logger().info(f"I heard, and thought about it: {message.data}")
        if heard == count:
            node.close()

    metaros.spin(node)
