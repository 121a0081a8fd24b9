"""Faults of ZeroMQ programs and nodes, each logged once, and a bounded number of them."""

from __future__ import annotations

import threading

from metaros.node import Node

__all__ = ["Faults"]

_MOST = 100


class Faults:
    """Warnings of the broker's node, on stderr and on /rosout."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._warned = 0
        self._lock = threading.Lock()

    def warn_once(self, about: object, text: str) -> None:
        """Warn, the first time for each `about`."""
        if not self._node.first_report(("zmq", about)):
            return
        with self._lock:
            self._warned += 1
            count = self._warned
        if count <= _MOST:
            self._node.get_logger().warn(text)
        if count == _MOST:
            self._node.get_logger().warn(f"{_MOST} kinds of faults: further ones are only counted")
