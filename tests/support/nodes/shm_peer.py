"""A peer process with shared memory, which tests kill.

`python -m tests.support.nodes.shm_peer ROLE ENDPOINT POOL`:

`hold` keeps the last samples that it got and never reads them, `receive` reads images and checks them, `publish`
publishes images until it dies, `once` one. Each prints a line for every few samples.
"""

from __future__ import annotations

import os
import sys
import threading
from collections import deque
from typing import Any

import numpy as np
import zenoh

import metaros
from metaros.interfaces.sensor_msgs.msg import Image
from metaros.wire import Congestion, QoSProfile

TOPIC = "/shm_test"
IMAGE_BYTES = 1 << 20
POOL_BYTES = (8 << 20) + 4096 * (os.getpid() % 256 + 1)  # a size that nobody else's files have


def image(number: int) -> Any:
    """An image of one grey, so that a torn one is noticed."""
    return Image(height=1, width=IMAGE_BYTES, data=np.full(IMAGE_BYTES, number & 255, np.uint8))


def publisher_of(context: metaros.Context, pool_bytes: int = POOL_BYTES) -> Any:
    """A publisher with a small pool, which waits where the network is slow: what is not lost arrives."""
    assert context.session.shared_pool is not None
    context.session.shared_pool.size_bytes = pool_bytes
    node = metaros.Node("sender", context=context, enable_rosout=False, enable_parameters=False)
    return node.create_publisher(Image, TOPIC, QoSProfile(depth=50, congestion=Congestion.BLOCK))


def _hold(context: metaros.Context) -> None:
    node = metaros.Node("holder", context=context, enable_rosout=False, enable_parameters=False)
    kept: deque[zenoh.Sample] = deque(maxlen=3)

    def keep(sample: zenoh.Sample) -> None:
        kept.append(sample)
        print("shared" if sample.payload.as_shm() is not None else "network", flush=True)

    node.create_raw_subscription(TOPIC, Image.__metaros_name__, Image.__metaros_hash__, metaros.qos_default, sink=keep)
    threading.Event().wait()


def _receive(context: metaros.Context) -> None:
    node = metaros.Node("receiver", context=context, enable_rosout=False, enable_parameters=False)

    def check(message: Any) -> None:
        sound = bool((message.data == message.data[0]).all()) and len(message.data) == IMAGE_BYTES
        print("sound" if sound else "torn", flush=True)

    node.create_subscription(Image, TOPIC, check, 3)
    print("ready", flush=True)
    metaros.spin(node)


def _publish(context: metaros.Context, pool_bytes: int, *, times: int) -> None:
    publisher, pause = publisher_of(context, pool_bytes), threading.Event()
    for number in range(times):
        publisher.publish(image(number))
        pause.wait(0.005)
    print("done", flush=True)


def main(role: str, endpoint: str, pool_bytes: str) -> None:
    """Be that end."""
    connect, listen = ([], endpoint) if role == "receive" else (endpoint, [])
    with metaros.Context(domain_id=0, connect=connect, listen=listen, shared_memory="auto") as context:
        if role == "hold":
            _hold(context)
        elif role == "receive":
            _receive(context)
        else:
            _publish(context, int(pool_bytes), times=1 if role == "once" else 1_000_000)


if __name__ == "__main__":
    main(*sys.argv[1:])
