"""When a device that is away is tried again. Pure."""

from __future__ import annotations

from typing import Final

__all__ = ["FIRST_S", "LAST_S", "BackOff"]

FIRST_S: Final = 0.25
LAST_S: Final = 0.5  # so that a device is back within two seconds of its return, also where opening takes one


class BackOff:
    """Waits that double from FIRST_S to LAST_S, and begin anew once the device has worked."""

    def __init__(self) -> None:
        self._next_s = FIRST_S

    def next_s(self) -> float:
        """How long to wait now."""
        wait_s, self._next_s = self._next_s, min(2 * self._next_s, LAST_S)
        return wait_s

    def worked(self) -> None:
        """The device gave a good reading."""
        self._next_s = FIRST_S
