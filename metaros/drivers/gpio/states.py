"""Inputs that are debounced, outputs that return to their safe state. Pure; outputs are thread-safe."""

from __future__ import annotations

import math
import threading

from metaros.drivers.gpio.pins import OutputPin

__all__ = ["Debounced", "OutputState"]


class Debounced:
    """Believes an input once it has stayed the same for a while."""

    def __init__(self) -> None:
        self.value: bool | None = None
        self._seen: bool | None = None
        self._since_s = 0.0

    def look(self, seen: bool, now_s: float, *, debounce_s: float) -> bool:
        """One reading; whether `value` is another now. The first reading is believed at once."""
        if seen != self._seen:
            self._seen, self._since_s = seen, now_s
        if seen == self.value or (self.value is not None and now_s - self._since_s < debounce_s):
            return False
        self.value = seen
        return True


class OutputState:
    """What an output is to be: set by commands, back to safe after its pulse or without refreshing."""

    def __init__(self, pin: OutputPin, *, watchdog_s: float) -> None:
        self._pin = pin
        self._watchdog_s = watchdog_s
        self._lock = threading.Lock()
        self._value = pin.safe
        self._until_s = math.inf

    def set(self, value: bool, now_s: float) -> None:
        """Obey a command. A pulse begins with the one that leaves the safe state; others do not prolong it."""
        pin = self._pin
        with self._lock:
            if value == pin.safe:
                self._until_s = math.inf
            elif pin.pulse_s and self._value == pin.safe:
                self._until_s = now_s + pin.pulse_s
            elif pin.watched and not pin.pulse_s:
                self._until_s = now_s + self._watchdog_s
            self._value = value

    def rest(self) -> None:
        """Safe, until a new command."""
        with self._lock:
            self._value, self._until_s = self._pin.safe, math.inf

    def value(self, now_s: float) -> bool:
        """What it is to be now."""
        with self._lock:
            if now_s >= self._until_s:
                self._value, self._until_s = self._pin.safe, math.inf
            return self._value
