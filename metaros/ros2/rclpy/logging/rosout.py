"""Which loggers send what they say to /rosout: those of nodes, and the children that programs ask them for."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any, Final

from metaros.ros2.rclpy.logging.console import Record
from metaros.ros2.rclpy.logging.levels import LEVELS, SEPARATOR
from metaros.ros2.rclpy.logging.severity import LoggingSeverity

__all__ = ["ROSOUT", "Rosout"]


class _Entry:
    """A logger's way to /rosout, with how many children of that name there are."""

    def __init__(self, node: Any) -> None:
        self.node = node
        self.count = 1

    @property
    def is_abandoned(self) -> bool:
        """Whether nobody has the node any more, and it will be gone soon."""
        return bool(getattr(self.node, "abandoned", False))

    def publish(self, record: Record) -> None:
        publish: Callable[..., None] | None = self.node.get_logger().rosout
        if publish is not None:
            publish(
                stamp_ns=record.stamp_ns,
                level=int(LoggingSeverity[record.severity]),
                name=record.name,
                msg=record.message,
                file=record.file,
                function=record.function,
                line=record.line,
            )


class _Attached:
    """A node's entry, for as long as the node is open: the node closes it with its endpoints."""

    def __init__(self, rosout: Rosout, node: Any, stop: Callable[[], None]) -> None:
        self._rosout, self._node, self._stop = rosout, node, stop

    def close(self) -> None:
        """The node is gone."""
        self._stop()
        self._rosout.detach(self._node)


class Rosout:
    """By logger's name. Thread-safe; of two nodes of one name the later one publishes."""

    def __init__(self) -> None:
        self._lock = threading.RLock()  # a logger that is collected calls `remove_child` in the middle of anything
        self._entries: dict[str, _Entry] = {}

    def attach(self, node: Any) -> None:
        """A node of this library is there; until it closes."""
        logger = node.get_logger()
        name = logger.name
        given = node.arguments.log_level
        if given and LEVELS.get(name) is LoggingSeverity.UNSET and given != LEVELS.effective(name).name:
            LEVELS.set(name, LoggingSeverity[given])  # what its own command line says of it

        def follow() -> None:
            logger.level = int(LEVELS.effective(name))

        follow()
        stop = LEVELS.on_change(follow)
        with self._lock:
            self._entries[name] = _Entry(node)
        node.adopt(_Attached(self, node, stop))

    def detach(self, node: Any) -> None:
        """It is gone, and its loggers publish no more."""
        with self._lock:
            for name in [name for name, entry in list(self._entries.items()) if entry.node is node]:
                self._entries.pop(name, None)

    def knows(self, name: str) -> bool:
        """Whether a logger of that name has a node."""
        entry = self._entries.get(name)
        return entry is not None and not entry.is_abandoned

    def add_child(self, parent: str, child: str) -> bool:
        """`parent.child` publishes as the parent does; False where the parent has no node."""
        name = f"{parent}{SEPARATOR}{child}"
        with self._lock:
            above = self._entries.get(parent)
            if above is None:
                return False
            entry = self._entries.get(name)
            if entry is None:
                self._entries[name] = _Entry(above.node)
            else:
                entry.count += 1
            return True

    def remove_child(self, name: str) -> None:
        """The reverse of `add_child`, by the child's whole name."""
        with self._lock:
            entry = self._entries.get(name)
            if entry is not None:
                entry.count -= 1
                if not entry.count:
                    del self._entries[name]

    def publish(self, record: Record) -> None:
        """Send it, if its logger has a node that does so."""
        entry = self._entries.get(record.name)
        if entry is not None:
            entry.publish(record)


ROSOUT: Final = Rosout()
