"""Detects pauses of the gateway's own event loop, which must not count as silence of a robot.

A gateway that has more to do than its core can has frames waiting that it did not read. To end those links as dead
would give it the work of opening them again, and a gateway that is late would become one that stands still.
"""

from __future__ import annotations

import math

__all__ = ["LATE_S", "StallDetector"]

LATE_S = 1.0  # a tick that comes so much after the one before was held up


class StallDetector:
    """Fed several times a second; pure."""

    def __init__(self) -> None:
        self._ticked_s = -math.inf
        self.since_s = -math.inf  # since when they came without a pause

    def tick(self, now_s: float) -> float:
        """One tick; returns since when there was no pause between them."""
        if now_s - self._ticked_s > LATE_S:
            self.since_s = now_s
        self._ticked_s = now_s
        return self.since_s
