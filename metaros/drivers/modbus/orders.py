"""What is to be written: the newest value of each writable point, and the safe one when orders end. Thread-safe."""

from __future__ import annotations

import threading
from collections.abc import Sequence

from metaros.drivers.modbus.points import Point

__all__ = ["Order", "Orders"]

Order = tuple[Point, tuple[int, ...]]


class Orders:
    """Orders come from the executor's thread, the driver's thread takes them."""

    def __init__(self, points: Sequence[Point]) -> None:
        self._points = {point.name: point for point in points if point.writable}
        self._lock = threading.Lock()
        self._waiting: dict[str, Order] = {}
        self._until_s: dict[str, float] = {}
        self._moved: set[str] = set()

    def give(self, name: str, value: float | bool, now_s: float) -> bool:
        """Whether it is an order: a value that the point can have."""
        point = self._points[name]
        registers = point.registers(value)
        if registers is None:
            return False
        with self._lock:
            self._waiting[name] = (point, registers)
            if point.watchdog_s:
                self._until_s[name] = now_s + point.watchdog_s
            if point.safe is not None:
                self._moved.add(name)
        return True

    def take(self, now_s: float) -> list[Order]:
        """What is to be written now; each once."""
        with self._lock:
            for name in [name for name, until_s in self._until_s.items() if now_s >= until_s]:
                del self._until_s[name]
                self._waiting[name] = self._safe(name)
            orders = list(self._waiting.values())
            self._waiting.clear()
            return orders

    def next_s(self) -> float | None:
        """When the next watchdog ends."""
        with self._lock:
            return min(self._until_s.values(), default=None)

    def end(self) -> list[Order]:
        """The safe values of what was moved since the last time; orders that wait are forgotten."""
        with self._lock:
            moved, self._moved = self._moved, set()
            self._waiting.clear()
            self._until_s.clear()
            return [self._safe(name) for name in sorted(moved)]

    def _safe(self, name: str) -> Order:
        point = self._points[name]
        registers = point.registers(point.safe if point.safe is not None else 0.0)
        assert registers is not None  # the map was checked
        return point, registers
