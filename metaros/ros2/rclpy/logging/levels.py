"""The levels of the process's loggers: one tree, `robot.driver` is below `robot`, and all are below the root, "".

The node of this library behind a node logger follows, so that its own messages go by the same level.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Final

from metaros.ros2.rclpy.logging.severity import LoggingSeverity

__all__ = ["LEVELS", "SEPARATOR", "Levels"]

SEPARATOR: Final = "."
_LEVELS_MOST: Final = 10_000  # names that others may set levels of, over a service


class Levels:
    """What level was set for which logger. Thread-safe."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._default = LoggingSeverity.INFO
        self._levels: dict[str, LoggingSeverity] = {}
        self._effective: dict[str, LoggingSeverity] = {}  # what was asked since the last change
        self._listeners: list[Callable[[], None]] = []

    def set(self, name: str, level: LoggingSeverity) -> None:
        """Set the level of a logger, "" is the root; RuntimeError where there are too many."""
        with self._lock:
            if not name:
                self._default = level
            elif name in self._levels or len(self._levels) < _LEVELS_MOST:
                self._levels[name] = level
            else:
                raise RuntimeError(f"{_LEVELS_MOST} loggers have a level, and no more can have one")
            self._effective = {}
        self._tell()

    def get(self, name: str) -> LoggingSeverity:
        """The level that was set for this very logger; UNSET where none was."""
        return self._levels.get(name, LoggingSeverity.UNSET) if name else self._default

    def effective(self, name: str) -> LoggingSeverity:
        """The level it goes by: its own, or that of the closest logger above it that has one."""
        known = self._effective
        level = known.get(name)
        if level is None:
            level = known[name] = self._find(name)
            if len(known) > _LEVELS_MOST:
                known.clear()
        return level

    def configure(self, default: str, levels: Mapping[str, str]) -> None:
        """What a command line says, by the names of the levels; an empty `default` changes nothing."""
        with self._lock:
            if default:
                self._default = LoggingSeverity[default]
            self._levels.update({name: LoggingSeverity[level] for name, level in levels.items()})
            self._effective = {}
        self._tell()

    def clear(self) -> None:
        """Back to the start: INFO for all."""
        with self._lock:
            self._default = LoggingSeverity.INFO
            self._levels, self._effective = {}, {}
        self._tell()

    def on_change(self, listener: Callable[[], None]) -> Callable[[], None]:
        """Call `listener()` after every change; returns how to stop that."""
        with self._lock:
            self._listeners.append(listener)
        return lambda: self._forget(listener)

    def _forget(self, listener: Callable[[], None]) -> None:
        with self._lock:
            if listener in self._listeners:
                self._listeners.remove(listener)

    def _tell(self) -> None:
        for listener in list(self._listeners):
            listener()

    def _find(self, name: str) -> LoggingSeverity:
        while name:
            level = self._levels.get(name, LoggingSeverity.UNSET)
            if level:
                return level
            name = name.rpartition(SEPARATOR)[0]
        return self._default


LEVELS: Final = Levels()
