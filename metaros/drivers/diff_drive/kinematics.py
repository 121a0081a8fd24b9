"""Two driven wheels: speeds of the base to ticks and back, and the place that they lead to. Pure.

Source: the unicycle model of any textbook (Siegwart, Nourbakhsh, Scaramuzza: Autonomous Mobile Robots, chapter 3);
a step is integrated as the exact arc of constant speeds.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["Pose", "Wheels", "moved", "wrapped"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wheels:
    """Geometry: metres, ticks in one turn of a wheel; +1 or -1 for each side's direction."""

    radius_m: float
    separation_m: float
    ticks_per_turn: float
    left_sign: int = 1
    right_sign: int = 1

    @property
    def tick_m(self) -> float:
        """Way of one tick."""
        return 2 * math.pi * self.radius_m / self.ticks_per_turn

    @property
    def tick_rad(self) -> float:
        """Turn of the wheel in one tick."""
        return 2 * math.pi / self.ticks_per_turn

    def ticks(self, linear: float, angular: float) -> tuple[float, float]:
        """Left and right for m/s and rad/s: in ticks a second (or for metres and radians: in ticks)."""
        half = angular * self.separation_m / 2
        return (
            self.left_sign * (linear - half) / self.tick_m,
            self.right_sign * (linear + half) / self.tick_m,
        )

    def way(self, left_ticks: float, right_ticks: float) -> tuple[float, float]:
        """Metres along the arc and radians turned, for so many ticks."""
        left, right = self.left_sign * left_ticks * self.tick_m, self.right_sign * right_ticks * self.tick_m
        return (left + right) / 2, (right - left) / self.separation_m


@dataclass(frozen=True, slots=True)
class Pose:
    """Metres and radians, -pi to pi; the variances grow with the way."""

    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0
    place_variance: float = 0.0
    yaw_variance: float = 0.0


def moved(pose: Pose, way_m: float, turn: float, *, error: float) -> Pose:
    """The pose after an arc; `error`: one sigma after one metre, and after one radian."""
    chord = way_m if abs(turn) < 1e-9 else way_m * math.sin(turn / 2) / (turn / 2)
    heading = pose.yaw + turn / 2
    # Errors of steps are taken as independent, so variances add up; an unsure yaw makes the way's end unsure.
    return Pose(
        pose.x + chord * math.cos(heading),
        pose.y + chord * math.sin(heading),
        math.remainder(pose.yaw + turn, 2 * math.pi),
        pose.place_variance + error * error * abs(way_m) + pose.yaw_variance * way_m * way_m,
        pose.yaw_variance + error * error * abs(turn),
    )


def wrapped(difference: int) -> int:
    """The difference of two 32-bit counts, over the wrap."""
    return (difference + 2**31) % 2**32 - 2**31
