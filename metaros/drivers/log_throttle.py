"""What was said lately, so that a device that stays away for hours does not fill the log. Pure."""

from __future__ import annotations

from typing import Final

from metaros.clock import Clock

__all__ = ["MAX_TEXTS", "QUIET_S", "Repeats"]

QUIET_S: Final = 60.0
MAX_TEXTS: Final = 32


class Repeats:
    """A text that was said is said again after QUIET_S at the earliest."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._said: dict[str, float] = {}

    def fresh(self, text: str) -> bool:
        """Whether to say it now; asking is saying."""
        now_s = self._clock.monotonic_s()
        self._said = {known: at_s for known, at_s in self._said.items() if now_s - at_s < QUIET_S}
        if text in self._said or len(self._said) >= MAX_TEXTS:
            return False
        self._said[text] = now_s
        return True
