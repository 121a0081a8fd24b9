"""Follows /clock: a node's simulated time is what its messages say."""

from __future__ import annotations

from typing import Any, Final

from metaros.idl import message_class
from metaros.node.core import NodeCore
from metaros.node.plain_values import make_subscription
from metaros.node.time.sim_time import SimClock
from metaros.wire import QoSProfile, Reliability

__all__ = ["follow_clock"]

_CLOCK_QOS: Final = QoSProfile(reliability=Reliability.BEST_EFFORT, depth=1)


def follow_clock(node: NodeCore, clock: SimClock) -> None:
    """Set the node's clock by /clock, on a thread of its own: a callback that waits for time must not stop it.

    After a jump every timer of the node gets a full period.
    """

    def changed(jumped: bool) -> None:
        if jumped:
            node.timers.jump()
        else:
            node.ingress.wake()

    def on_clock(message: Any) -> None:
        clock.set_ns(message.clock.sec * 1_000_000_000 + message.clock.nanosec)

    clock.on_set(changed)
    kind = message_class("rosgraph_msgs/msg/Clock")
    make_subscription(node, kind, "/clock", on_clock, _CLOCK_QOS.resolved(), dedicated=True)
