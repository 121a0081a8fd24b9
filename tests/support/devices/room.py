"""A rectangular room that lidars measure: the device stands in it off the middle and looks along x."""

from __future__ import annotations

import math

__all__ = ["AHEAD_M", "BEHIND_M", "LEFT_M", "RIGHT_M", "distance_m", "distances_m"]

AHEAD_M, BEHIND_M, LEFT_M, RIGHT_M = 3.0, 2.0, 1.5, 1.0


def distance_m(clockwise_deg: float) -> float:
    """To the wall, at an angle as lidars count it: clockwise from ahead."""
    angle = math.radians(clockwise_deg)
    x, y = math.cos(angle), -math.sin(angle)
    along = (AHEAD_M if x > 0 else BEHIND_M) / max(abs(x), 1e-9)
    across = (LEFT_M if y > 0 else RIGHT_M) / max(abs(y), 1e-9)
    return min(along, across)


def distances_m(angles_deg: list[float]) -> list[float]:
    """To the walls."""
    return [distance_m(angle) for angle in angles_deg]
