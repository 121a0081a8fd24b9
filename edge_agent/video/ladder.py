"""The bit rate that a video source is asked for: down at once when the link is behind, up again step by step. Pure."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import Final

__all__ = ["RUNGS_BPS", "Ladder"]

RUNGS_BPS: Final = (
    *(150_000, 250_000, 400_000, 650_000, 1_000_000),
    *(1_600_000, 2_500_000, 4_000_000, 6_500_000, 10_000_000),
)
ROOM: Final = 0.8  # of what went through: what waits has to go as well
SETTLE_S: Final = 1.0  # until the last step down has had its effect
CALM_S: Final = 4.0  # without a backlog, for one step up


class Ladder:
    """One channel's. It stands on no rung, 0, while there is no reason to ask for less than the source sends."""

    def __init__(self) -> None:
        self._rung: int | None = None
        self._moved_s = -math.inf

    def look(self, *, behind: bool, sent_bps: float, most_bps: float, now_s: float) -> int:
        """Bits a second to ask for. `most_bps` is the channel's share of the budget, 0 without one."""
        if behind and now_s - self._moved_s >= SETTLE_S:
            self._down(sent_bps)
            self._moved_s = now_s
        elif not behind and self._rung is not None and now_s - self._moved_s >= CALM_S:
            self._rung = self._rung + 1 if self._rung + 1 < len(RUNGS_BPS) else None
            self._moved_s = now_s
        most = RUNGS_BPS[highest(most_bps)] if most_bps > 0 else 0
        if self._rung is None:
            return most
        return min(RUNGS_BPS[self._rung], most or RUNGS_BPS[-1])

    def _down(self, sent_bps: float) -> None:
        found = highest(ROOM * sent_bps)
        self._rung = found if self._rung is None else max(0, min(found, self._rung - 1))


def highest(bps: float) -> int:
    """The highest rung that is not above it; the lowest where all are."""
    return max(0, bisect_right(RUNGS_BPS, bps) - 1)
