"""How good the video is that the link carries: rungs of size and bit rate, and when to take another. Pure."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

__all__ = ["KEY_EVERY_S", "UP_AFTER_S", "KeyFrames", "Ladder", "Rung"]

UP_AFTER_S: Final = 3.0
KEY_EVERY_S: Final = 0.25
HEARD_FOR_S: Final = 10.0  # the agent says what it wants every 2 s while somebody looks
_SHARES: Final = ((1.0, 1.0), (1.0, 0.5), (0.66, 0.3), (0.5, 0.18), (0.33, 0.1), (0.25, 0.05))
MIN_WIDTH: Final = 128
MIN_BITRATE_BPS: Final = 50_000


@dataclass(frozen=True, slots=True)
class Rung:
    """A size and a bit rate."""

    width: int
    height: int
    bitrate_bps: int


class Ladder:
    """From what was set downwards. Down at once, up one rung after the link has carried more for UP_AFTER_S."""

    def __init__(self, width: int, height: int, bitrate_bps: int) -> None:
        self.rungs = tuple(
            Rung(_even(width * size), _even(height * size), max(MIN_BITRATE_BPS, round(bitrate_bps * share)))
            for size, share in _SHARES
            if size == 1.0 or width * size >= MIN_WIDTH
        )
        self._at = 0
        self._more_since_s: float | None = None

    @property
    def rung(self) -> Rung:
        """Where it is."""
        return self.rungs[self._at]

    def carry(self, bitrate_bps: int, now_s: float) -> Rung:
        """What to encode while the link carries so much; 0: nobody knows of a limit."""
        budget = bitrate_bps or self.rungs[0].bitrate_bps
        fits = next((n for n, rung in enumerate(self.rungs) if rung.bitrate_bps <= budget), len(self.rungs) - 1)
        if fits >= self._at:
            self._at, self._more_since_s = fits, None
        elif self._more_since_s is None:
            self._more_since_s = now_s
        elif now_s - self._more_since_s >= UP_AFTER_S:
            self._at, self._more_since_s = self._at - 1, now_s
        return self.rung


class KeyFrames:
    """When the next picture is to be a key frame: as soon as it is asked for, but KEY_EVERY_S apart."""

    def __init__(self) -> None:
        self._wanted = False
        self._last_s = float("-inf")

    def ask(self) -> None:
        """Somebody needs one."""
        self._wanted = True

    def due(self, now_s: float) -> bool:
        """Whether this picture is to be one; then it is given."""
        if not self._wanted or now_s - self._last_s < KEY_EVERY_S:
            return False
        self._wanted, self._last_s = False, now_s
        return True


def _even(size: float) -> int:
    return max(16, round(size) // 2 * 2)  # 4:2:0 has half as many colours in each direction
