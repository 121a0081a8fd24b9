"""Whether this gateway listened: only then is a robot's silence the robot's.

A gateway that has more to do than its core can has frames waiting that it did not read. To end those links as dead
would give it the work of opening them again, and a gateway that is late would become one that stands still.
"""

from __future__ import annotations

import math

__all__ = ["LATE_S", "Attention"]

LATE_S = 1.0  # a look that comes so much after the one before was kept from coming


class Attention:
    """Looks that should come several times a second; pure."""

    def __init__(self) -> None:
        self._looked_s = -math.inf
        self.since_s = -math.inf  # since when they came without a pause

    def look(self, now_s: float) -> float:
        """One look; since when there was no pause between them."""
        if now_s - self._looked_s > LATE_S:
            self.since_s = now_s
        self._looked_s = now_s
        return self.since_s
