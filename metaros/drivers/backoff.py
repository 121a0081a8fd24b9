"""Retry delays for a disconnected device. Pure."""

from __future__ import annotations

from typing import Final

__all__ = ["FIRST_S", "LAST_S", "Backoff"]

FIRST_S: Final = 0.25
LAST_S: Final = 0.5  # so that a device is back within two seconds of its return, also where opening takes one


class Backoff:
    """Delays that double from `first_s` to `last_s`, and start again once the device has worked."""

    def __init__(self, *, first_s: float = FIRST_S, last_s: float = LAST_S) -> None:
        self._first_s = self._next_s = first_s
        self._last_s = last_s

    def next_s(self) -> float:
        """How long to wait now."""
        wait_s, self._next_s = self._next_s, min(2 * self._next_s, self._last_s)
        return wait_s

    def reset(self) -> None:
        """The device gave a good reading."""
        self._next_s = self._first_s
