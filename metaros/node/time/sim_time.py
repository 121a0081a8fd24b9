"""Simulated time: a clock that shows what /clock says."""

from __future__ import annotations

import threading
from collections.abc import Callable

__all__ = ["SimClock"]


class SimClock:
    """A `Clock` that stands at zero until the first message and then shows the newest one's time.

    `monotonic_s` is the same time: it goes back where the simulation does, and whoever waits is told by `on_set`.
    """

    def __init__(self) -> None:
        self._now_ns = 0
        self._listeners: list[Callable[[bool], object]] = []
        self._lock = threading.Lock()

    def wall_ns(self) -> int:
        """Nanoseconds of simulated time."""
        return self._now_ns

    def monotonic_s(self) -> float:
        """Seconds of simulated time."""
        return self._now_ns / 1e9

    def set_ns(self, now_ns: int) -> None:
        """It is so late now. From standing at zero, and backwards, it jumps; else it runs."""
        jumped = now_ns < self._now_ns or self._now_ns == 0
        self._now_ns = now_ns
        with self._lock:
            listeners = list(self._listeners)
        for listener in listeners:
            listener(jumped)

    def on_set(self, listener: Callable[[bool], object]) -> Callable[[], None]:
        """Call `listener(jumped)` whenever the time is set; returns how to stop that. It must not block."""
        with self._lock:
            self._listeners.append(listener)

        def stop() -> None:
            with self._lock:
                if listener in self._listeners:
                    self._listeners.remove(listener)

        return stop
