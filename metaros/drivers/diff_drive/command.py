"""What the base is to do now: fresh commands within limits, or nothing. Pure; thread-safe."""

from __future__ import annotations

import math
import threading

__all__ = ["CommandGate"]


class CommandGate:
    """Commands come from the executor's thread, the driver's thread asks for the speeds of now."""

    def __init__(
        self,
        *,
        max_linear: float,
        max_angular: float,
        linear_acceleration: float,
        angular_acceleration: float,
        watchdog_s: float,
    ) -> None:
        self._most = (max_linear, max_angular)
        self._acceleration = (linear_acceleration, angular_acceleration)
        self._watchdog_s = watchdog_s
        self._lock = threading.Lock()
        self._wanted = (0.0, 0.0)
        self._until_s = -math.inf
        self._speeds = (0.0, 0.0)
        self._asked_s: float | None = None
        self._stopped = False

    @property
    def stopped(self) -> bool:
        """Whether it was stopped, and not released since."""
        return self._stopped

    def command(self, linear: float, angular: float, now_s: float) -> bool:
        """Take a command; whether it is one: numbers, and nobody stopped the base."""
        if not (math.isfinite(linear) and math.isfinite(angular)):
            return False
        with self._lock:
            if self._stopped:
                return False
            self._wanted = (_within(linear, self._most[0]), _within(angular, self._most[1]))
            self._until_s = now_s + self._watchdog_s
        return True

    def stop(self) -> None:
        """Stand still until `release`, whatever is commanded."""
        with self._lock:
            self._stopped = True
            self._forget()

    def release(self) -> None:
        """Obey commands that come from now on."""
        with self._lock:
            self._stopped = False

    def forget(self) -> None:
        """Stand still until a new command: the device was away."""
        with self._lock:
            self._forget()

    def speeds(self, now_s: float) -> tuple[float, float]:
        """m/s and rad/s for now: towards what is wanted within the accelerations; a stop is at once."""
        with self._lock:
            step_s = 0.0 if self._asked_s is None else max(0.0, now_s - self._asked_s)
            self._asked_s = now_s
            if self._stopped or now_s >= self._until_s:
                self._forget()
            else:
                linear, angular = (
                    speed + _within(wanted - speed, most * step_s)
                    for speed, wanted, most in zip(self._speeds, self._wanted, self._acceleration, strict=True)
                )
                self._speeds = (linear, angular)
            return self._speeds

    def _forget(self) -> None:
        self._wanted = self._speeds = (0.0, 0.0)
        self._until_s = -math.inf


def _within(value: float, most: float) -> float:
    return max(-most, min(most, value))
