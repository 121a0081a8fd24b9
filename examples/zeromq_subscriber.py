"""Print what arrives on /chatter with plain ZeroMQ: no Meta-ROS in it. `metaros broker` brings it from ROS nodes.

A subscription is the beginning of a message: `/chatter ` with its space is this topic and no other. `--count N` ends
after N messages.
"""

from __future__ import annotations

import argparse
import json
from contextlib import suppress

import zmq

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--count", type=int, default=0, help="how many messages; 0 means for ever")
parser.add_argument("--port", type=int, default=5556, help="the broker's port for subscribers")
arguments = parser.parse_args()

heard = 0
with suppress(KeyboardInterrupt), zmq.Context() as context, context.socket(zmq.SUB) as subscriber:
    subscriber.connect(f"tcp://127.0.0.1:{arguments.port}")
    subscriber.subscribe("/chatter ")
    while heard < arguments.count or not arguments.count:
        topic, _, payload = subscriber.recv_string().partition(" ")
        print(f"{topic}: {json.loads(payload)['data']}")
        heard += 1
