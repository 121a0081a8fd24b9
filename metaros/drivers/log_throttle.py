"""Throttles repeated log lines: a device that stays disconnected for hours does not fill the log. Pure."""

from __future__ import annotations

from typing import Final

from metaros.clock import Clock

__all__ = ["MAX_TEXTS", "QUIET_S", "LogThrottle"]

QUIET_S: Final = 60.0
MAX_TEXTS: Final = 32


class LogThrottle:
    """A text that was logged is logged again after QUIET_S at the earliest."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._said: dict[str, float] = {}

    def should_log(self, text: str) -> bool:
        """Whether to log it now; if so it counts as logged."""
        now_s = self._clock.monotonic_s()
        self._said = {known: at_s for known, at_s in self._said.items() if now_s - at_s < QUIET_S}
        if text in self._said or len(self._said) >= MAX_TEXTS:
            return False
        self._said[text] = now_s
        return True
