"""Pending writes: the newest value of each writable point, and the safe one when commands end. Thread-safe."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Final

from metaros.drivers.modbus.points import Point

__all__ = ["AGAIN_S", "PendingWrites", "Write"]

AGAIN_S: Final = 0.25
Write = tuple[Point, tuple[int, ...]]


class PendingWrites:
    """Writes are requested on the executor's thread, the driver's thread takes them."""

    def __init__(self, points: Sequence[Point]) -> None:
        self._points = {point.name: point for point in points if point.writable}
        self._lock = threading.Lock()
        self._waiting: dict[str, Write] = {}
        self._until_s: dict[str, float] = {}
        self._safe_due_s: dict[str, float] = {}  # whose safe value is to be written, again and again until it is
        self._moved: set[str] = set()

    def give(self, name: str, value: float | bool, now_s: float) -> bool:
        """Queue a write; False for a value that the point cannot have."""
        point = self._points[name]
        registers = point.registers(value)
        if registers is None:
            return False
        with self._lock:
            self._waiting[name] = (point, registers)
            self._safe_due_s.pop(name, None)
            if point.watchdog_s:
                self._until_s[name] = now_s + point.watchdog_s
            if point.safe is not None:
                self._moved.add(name)
        return True

    def take(self, now_s: float) -> list[Write]:
        """What is to be written now: a value once, the safe value of a watchdog until it is `written`."""
        with self._lock:
            for name in [name for name, until_s in self._until_s.items() if now_s >= until_s]:
                del self._until_s[name]
                self._waiting.pop(name, None)
                self._safe_due_s[name] = now_s
            orders = list(self._waiting.values())
            self._waiting.clear()
            for name in [name for name, due_s in self._safe_due_s.items() if now_s >= due_s]:
                self._safe_due_s[name] = now_s + AGAIN_S
                orders.append(self._safe(name))
            return orders

    def written(self, point: Point, registers: tuple[int, ...]) -> None:
        """The device has acknowledged a write."""
        with self._lock:
            if point.name in self._safe_due_s and registers == self._safe(point.name)[1]:
                del self._safe_due_s[point.name]

    def unwritten(self, point: Point) -> None:
        """The safe value could not be written at the end: it is among those of the next `end`."""
        with self._lock:
            self._moved.add(point.name)

    def end(self) -> list[Write]:
        """The safe values of what was moved since the last time; pending writes are dropped."""
        with self._lock:
            moved, self._moved = self._moved, set()
            self._waiting.clear()
            self._until_s.clear()
            self._safe_due_s.clear()
            return [self._safe(name) for name in sorted(moved)]

    def _safe(self, name: str) -> Write:
        point = self._points[name]
        registers = point.registers(point.safe if point.safe is not None else 0.0)
        assert registers is not None  # the map was checked
        return point, registers
