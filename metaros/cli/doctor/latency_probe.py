"""The doctor's round-trip probe: messages from one session through the router to another, each timed."""

from __future__ import annotations

import queue
from typing import TYPE_CHECKING

from metaros.clock import SystemClock
from metaros.concurrency.waiting import WaitQueue, pause

if TYPE_CHECKING:
    from metaros.node import Context

__all__ = ["round_trips"]

_WAIT_S = 1.0


def round_trips(context: Context, *, zenoh_port: int, domain: int, rounds: int) -> list[float]:
    """Seconds from publish to arrival in another session; fewer than `rounds` where messages were lost."""
    from metaros.cli.shared.connection import connect
    from metaros.idl import message_class, type_hash
    from metaros.node import Node
    from metaros.wire import qos_default

    type_name, clock = "std_msgs/msg/UInt64", SystemClock()
    arrived: WaitQueue[float] = WaitQueue()
    message = message_class(type_name)
    topic = f"/_metaros_canary_{context.zid[:8]}"  # hidden: no list and no agent takes it for a robot's
    with connect(zenoh_port, domain) as other:
        reader = Node("metaros_canary_reader", context=other, enable_rosout=False, enable_parameters=False)
        writer = Node("metaros_canary_writer", context=context, enable_rosout=False, enable_parameters=False)
        with reader, writer:
            reader.create_raw_subscription(
                topic, type_name, type_hash(type_name), qos_default, lambda _: arrived.put(clock.monotonic_s())
            )
            publisher = writer.create_publisher(message, topic, 10)
            context.graph.wait_for(lambda: bool(context.graph.endpoints(topic=topic, kind="MS")), _WAIT_S)
            times = []
            for number in range(rounds):
                sent = clock.monotonic_s()
                publisher.publish(message(data=number))
                try:
                    times.append(arrived.get(_WAIT_S) - sent)
                except queue.Empty:
                    break
                pause(0.002)  # spread out, or the pipe is warmer than a robot's ever is
    return times
