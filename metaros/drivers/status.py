"""A driver's status: state, counters, rate and age of readings. Thread-safe enough: numbers and texts only."""

from __future__ import annotations

import threading
from collections import Counter, deque
from enum import StrEnum
from typing import Final

from metaros.clock import Clock

__all__ = ["DriverState", "DriverStatus"]

_RATE_WINDOW: Final = 64
MAX_COUNTERS: Final = 64


class DriverState(StrEnum):
    """Where a driver is."""

    RESTING = "resting"
    OPENING = "opening"
    WORKING = "working"
    STALE = "stale"
    WAITING = "waiting"
    FAILED = "failed"


class DriverStatus:
    """The source of a driver's diagnostics."""

    def __init__(self, clock: Clock, *, stale_after_s: float) -> None:
        self._clock = clock
        self._stale_after_s = stale_after_s
        self._lock = threading.Lock()
        self._state = DriverState.RESTING
        self._since_s = clock.monotonic_s()
        self._readings: deque[float] = deque(maxlen=_RATE_WINDOW)
        self.detail = ""
        self.hardware_id = ""
        self.warning = ""
        self.counters: Counter[str] = Counter()
        self.facts: dict[str, str] = {}
        self.changes = 0

    @property
    def state(self) -> DriverState:
        """Now: a driver that works and has had no reading for long is stale."""
        if self._state is DriverState.WORKING and self._stale_after_s and self.age_s() > self._stale_after_s:
            return DriverState.STALE
        return self._state

    def enter(self, state: DriverState, detail: str = "") -> None:
        """Be in another state."""
        if state is not self._state or detail != self.detail:
            self.changes += 1
        if state is not self._state:
            self._since_s = self._clock.monotonic_s()
        if state is not DriverState.WORKING:
            self.warning = ""
        self._state, self.detail = state, detail

    def opened(self, detail: str, hardware_id: str) -> None:
        """The device answers."""
        self.hardware_id = hardware_id or self.hardware_id
        self._readings.clear()
        self.enter(DriverState.WORKING, detail)

    def reading(self) -> None:
        """A reading was published."""
        self._readings.append(self._clock.monotonic_s())
        self.count("readings")

    def count(self, name: str, by: int = 1) -> None:
        """Add to a counter; names beyond MAX_COUNTERS are added up under `other`."""
        with self._lock:
            self.counters[name if name in self.counters or len(self.counters) < MAX_COUNTERS else "other"] += by

    def age_s(self) -> float:
        """How long ago the last reading was, or the device was opened."""
        readings = self._readings
        return self._clock.monotonic_s() - max(self._since_s, readings[-1] if readings else 0.0)

    def rate_hz(self) -> float:
        """Readings a second, over the latest; 0 once they have stopped."""
        readings = list(self._readings)
        if len(readings) < 2 or readings[-1] <= readings[0]:
            return 0.0
        period_s = (readings[-1] - readings[0]) / (len(readings) - 1)
        return 0.0 if self._clock.monotonic_s() - readings[-1] > 3 * period_s + 1 else 1 / period_s
