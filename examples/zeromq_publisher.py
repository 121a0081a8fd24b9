"""Publish a counter on /chatter with plain ZeroMQ: no Meta-ROS in it. `metaros broker` carries it to ROS nodes.

A message is one frame, `/topic {json}`: what the Publisher of `metaros` 1.x sends. `--count N` ends after N messages.
"""

from __future__ import annotations

import argparse
import itertools
import json
import threading
from contextlib import suppress

import zmq

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--count", type=int, default=0, help="how many messages; 0 means for ever")
parser.add_argument("--port", type=int, default=5555, help="the broker's port for publishers")
arguments = parser.parse_args()

pause = threading.Event()
with suppress(KeyboardInterrupt), zmq.Context() as context, context.socket(zmq.PUB) as publisher:
    publisher.linger = 1000  # at the end wait a second at most for what is not sent yet
    publisher.connect(f"tcp://127.0.0.1:{arguments.port}")
    for number in itertools.count(1):
        pause.wait(0.5)
        text = f"Hello World: {number}"
        publisher.send_string(f"/chatter {json.dumps({'data': text})}")
        print(f"Publishing: {text}")
        if number == arguments.count:
            break
