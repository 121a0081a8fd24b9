"""Arbitrates between the autopilot and `cmd_vel`, with the base's own watchdog (design D13). No I/O.

autonomous ──command──▶ commanded ──no command for 300 ms──▶ standing ──resume, or resume_after_s──▶ autonomous
                            ▲────────────────command────────────────┘
"""

from __future__ import annotations

import math
from enum import Enum

from metaros.limits import LIMITS

__all__ = ["CommandGate", "Mode"]


class Mode(Enum):
    """Which source drives now."""

    AUTONOMOUS = "autonomous"
    COMMANDED = "commanded"
    STANDING = "standing"


class CommandGate:
    """Takes commands and the time, says what the wheels shall do. `linear`/`angular` are m/s and rad/s.

    `resume_after_s` may be changed at any time.
    """

    def __init__(self, *, resume_after_s: float = 10.0, watchdog_s: float = LIMITS.teleop_fresh_s) -> None:
        self.mode = Mode.AUTONOMOUS
        self.rejected = 0
        self.resume_after_s = resume_after_s
        self._watchdog_s = watchdog_s
        self._command = (0.0, 0.0)
        self._commanded_at = -math.inf
        self._standing_since = -math.inf

    def command(self, linear: float, angular: float, *, now_s: float) -> str | None:
        """Obey a command from now on; returns a line for the log when that changes who drives.

        A command that is not finite is counted in `rejected` and changes nothing, so that the watchdog ends it.
        """
        if not (math.isfinite(linear) and math.isfinite(angular)):
            self.rejected += 1
            return "cmd_vel ignored: its speed is not a finite number" if self.rejected == 1 else None
        before, self.mode = self.mode, Mode.COMMANDED
        self._command = (linear, angular)
        self._commanded_at = now_s
        return None if before is Mode.COMMANDED else "taken over by cmd_vel"

    def resume(self) -> tuple[bool, str]:
        """Go back to autonomy now: (whether that is so, why). Refused while commands are arriving."""
        if self.mode is Mode.COMMANDED:
            return False, "cmd_vel is still driving the robot; stop sending commands first"
        if self.mode is Mode.AUTONOMOUS:
            return True, "the robot drives itself already"
        self.mode = Mode.AUTONOMOUS
        return True, "resumed autonomy on request"

    def poll(self, *, now_s: float) -> str | None:
        """Let time act: the watchdog, then the way back to autonomy. Returns a line for the log on a change."""
        if self.mode is Mode.COMMANDED and now_s - self._commanded_at > self._watchdog_s:
            self.mode = Mode.STANDING
            self._standing_since = now_s
            self._command = (0.0, 0.0)
            return f"no cmd_vel for {self._watchdog_s * 1000:.0f} ms: stopped by the watchdog"
        if self.mode is Mode.STANDING and now_s - self._standing_since >= self.resume_after_s:
            self.mode = Mode.AUTONOMOUS
            return f"resumed autonomy after {self.resume_after_s:g} s without a command"
        return None

    def target(self) -> tuple[float, float] | None:
        """(linear, angular) to follow, or None when the robot drives itself."""
        return None if self.mode is Mode.AUTONOMOUS else self._command
