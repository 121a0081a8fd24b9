"""What every filter is: something that hands messages on to callbacks."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

__all__ = ["SimpleFilter", "Subscriber", "stamp_of"]


class SimpleFilter:
    """Calls each registered callback with what it puts out."""

    def __init__(self) -> None:
        self.callbacks: dict[int, tuple[Callable[..., Any], tuple[Any, ...]]] = {}
        self._connections = itertools.count()

    def registerCallback(self, cb: Callable[..., Any], *args: Any) -> int:
        """Call `cb(*messages, *args)` for each output; the number of the connection, a key of `callbacks`."""
        connection = next(self._connections)
        self.callbacks[connection] = (cb, args)
        return connection

    def signalMessage(self, *msg: Any) -> None:
        """Put this out."""
        for callback, args in list(self.callbacks.values()):
            callback(*msg, *args)


class Subscriber(SimpleFilter):
    """A subscription as a filter: `Subscriber(node, type, topic, qos_profile=10, …)`, as `node.create_subscription`.

    Attributes of the subscription, such as `topic_name`, are attributes of this.
    """

    def __init__(self, node: Any, msg_type: Any, topic: str, *args: Any, **kwargs: Any) -> None:
        super().__init__()
        self.node = node
        self.topic = topic
        if args:
            kwargs["qos_profile"], *more = args
            if more:
                raise TypeError("Subscriber takes a node, a type, a topic and a QoS profile; the rest by keyword")
        kwargs.setdefault("qos_profile", 10)
        self.sub = node.create_subscription(msg_type, topic, self.callback, **kwargs)

    def callback(self, msg: Any) -> None:
        """A message has come."""
        self.signalMessage(msg)

    def getTopic(self) -> str:
        """The topic as it was given."""
        return self.topic

    def __getattr__(self, key: str) -> Any:
        if key == "sub":
            raise AttributeError("the subscription could not be created")
        return getattr(self.sub, key)


def stamp_of(message: Any, allow_headerless: bool, logger: str) -> Any:
    """The `rclpy.time.Time` in the message's header, or now by the ROS clock where there is none and that is allowed.

    None where it is not allowed; then the log says so.
    """
    from metaros.ros2.rclpy.time.time import Time

    stamp = getattr(getattr(message, "header", None), "stamp", None)
    if stamp is not None:
        return stamp if hasattr(stamp, "nanoseconds") else Time.from_msg(stamp)
    if allow_headerless:
        return now()
    from metaros.ros2.rclpy.logging.loggers import get_logger

    get_logger(logger).warning(
        f"a message of {type(message).__name__} is left out: it has no header with a time. "
        "With 'allow_headerless' the time when it came is taken instead"
    )
    return None


def now() -> Any:
    """The time by the ROS clock, an `rclpy.time.Time`."""
    from metaros.ros2.rclpy.time.clock import ROSClock

    return ROSClock().now()
