"""Faults of ZeroMQ programs and nodes, each told once, and not without an end: a peer's nonsense may have no end."""

from __future__ import annotations

import threading

from metaros.node import Node

__all__ = ["Faults"]

_MOST = 100


class Faults:
    """Warnings of the broker's node, on stderr and on /rosout."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._told = 0
        self._lock = threading.Lock()

    def tell(self, about: object, text: str) -> None:
        """Warn, the first time that `about` is told of."""
        if not self._node.first_report(("zmq", about)):
            return
        with self._lock:
            self._told += 1
            told = self._told
        if told <= _MOST:
            self._node.get_logger().warn(text)
        if told == _MOST:
            self._node.get_logger().warn(f"{_MOST} kinds of faults: further ones are only counted")
