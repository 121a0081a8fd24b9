"""The velocity setpoint: fresh commands within limits, then zero for a while, then nothing. Pure."""

from __future__ import annotations

import math
import threading
from typing import Final

__all__ = ["FAREWELL_S", "Limits", "VelocityGate"]

FAREWELL_S: Final = 0.5  # so long zero is said when commands have stopped; then the autopilot is left alone

Velocity = tuple[float, float, float, float]
Limits = tuple[float, float, float]  # horizontal m/s, vertical m/s, turning rad/s
ZERO: Final[Velocity] = (0.0, 0.0, 0.0, 0.0)


class VelocityGate:
    """Commands come from a thread of the executor, the driver's thread asks for the velocity of now."""

    def __init__(self, limits: Limits, *, watchdog_s: float) -> None:
        self._limits = limits
        self._watchdog_s = watchdog_s
        self._lock = threading.Lock()
        self._wanted: Velocity = ZERO
        self._until_s = -math.inf

    def command(self, velocity: Velocity, now_s: float) -> bool:
        """Take forward, left and up in m/s, and a turn to the left in rad/s; whether they are numbers."""
        if not all(map(math.isfinite, velocity)):
            return False
        x, y, z, turn = velocity
        across, up, turning = self._limits
        shrink = min(1.0, across / speed) if (speed := math.hypot(x, y)) > 0 else 1.0
        limited = (x * shrink, y * shrink, max(-up, min(up, z)), max(-turning, min(turning, turn)))
        with self._lock:
            self._wanted, self._until_s = limited, now_s + self._watchdog_s
        return True

    def velocity(self, now_s: float) -> Velocity | None:
        """What to say now; None: nothing at all."""
        with self._lock:
            if now_s < self._until_s:
                return self._wanted
            if now_s < self._until_s + FAREWELL_S:
                return ZERO
            self._until_s = -math.inf  # what somebody else tells the autopilot from now on is not disturbed
            return None

    def forget(self) -> bool:
        """Say nothing until a new command; whether a velocity was being said."""
        with self._lock:
            said, self._until_s = self._until_s > -math.inf, -math.inf
            return said
