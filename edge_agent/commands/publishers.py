"""Raw publishers for remote commands, made on first use and cached (LRU)."""

from __future__ import annotations

from collections import OrderedDict

from metaros.cdr import codec
from metaros.idl import message_class
from metaros.node import Node, RawPublisher
from metaros.wire import qos_default

__all__ = ["Publishers", "zero_message"]

KEPT = 64


class Publishers:
    """Publishes CDR on any topic of the robot."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._open: OrderedDict[tuple[str, str, str], RawPublisher] = OrderedDict()

    def publish(self, topic: str, type_name: str, type_hash: str, payload: bytes) -> None:
        """Put one message on the topic.

        Raises:
            NameError_: topic, type or hash is not what ROS 2 allows.
        """
        key = (topic, type_name, type_hash)
        publisher = self._open.get(key)
        if publisher is None:
            publisher = self._open[key] = self._node.create_raw_publisher(topic, type_name, type_hash, qos_default)
            if len(self._open) > KEPT:
                self._open.popitem(last=False)[1].close()
        self._open.move_to_end(key)
        publisher.publish(payload)

    def close(self) -> None:
        """Close all of them."""
        while self._open:
            self._open.popitem()[1].close()


def zero_message(type_name: str) -> bytes:
    """The CDR of a type's default value, which stops what a Twist drives.

    Raises:
        UnknownTypeError: the catalogue has no such type.
    """
    return codec(type_name).encode(message_class(type_name)())
