"""`rclpy.wait_for_message`: one message of a topic, without spinning."""

from __future__ import annotations

from queue import Empty
from typing import Any

from metaros.clock import SystemClock
from metaros.concurrency.waiting import WaitQueue
from metaros.ros2.rclpy.core.endpoint_methods import qos_or_depth
from metaros.ros2.rclpy.core.handles import Resolved, SubscriptionHandle
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.qos.conversion import to_native
from metaros.ros2.rclpy.qos.profile import QoSProfile

__all__ = ["wait_for_message"]


def wait_for_message(
    msg_type: type[Any],
    node: Node,
    topic: str,
    time_to_wait: float = -1,
    *,
    qos_profile: QoSProfile | int = 1,
) -> tuple[bool, Any]:
    """Wait for the next message, for so many seconds or, where that is negative, until the context is shut down.

    (True, message), or (False, None) where none came. The node may be spun meanwhile, or not: that makes no difference.
    """
    found: WaitQueue[Any] = WaitQueue()
    until_s = None if time_to_wait < 0 else SystemClock.monotonic_s() + time_to_wait
    ended = object()
    stop = node.context.wake_with(lambda: found.put(ended))
    full = Resolved(node.resolve_topic_name(topic))
    native_qos = to_native(qos_or_depth(qos_profile))
    subscription = SubscriptionHandle(node.handle, msg_type, full, native_qos, found.put, dedicated=True)
    try:
        if not node.context.ok():
            return False, None
        message = found.get(None if until_s is None else max(0.0, until_s - SystemClock.monotonic_s()))
    except Empty:
        return False, None
    finally:
        stop()
        subscription.close()
    return (False, None) if message is ended else (True, message)
