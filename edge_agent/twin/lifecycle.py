"""The way from one lifecycle state to another, step by step. Pure."""

from __future__ import annotations

from typing import Final

__all__ = ["RESTING", "next_step"]

RESTING: Final = ("unconfigured", "inactive", "active", "finalized")
_CONFIGURE, _CLEANUP, _ACTIVATE, _DEACTIVATE = 1, 2, 3, 4
_SHUTDOWN: Final = {"unconfigured": 5, "inactive": 6, "active": 7}
_UP: Final = {"unconfigured": _CONFIGURE, "inactive": _ACTIVATE}
_DOWN: Final = {"active": _DEACTIVATE, "inactive": _CLEANUP}


def next_step(state: str, wanted: str) -> int | None:
    """The transition to ask for next, as lifecycle_msgs numbers them; None where no way leads on."""
    if state == wanted or state not in RESTING or wanted not in RESTING or state == "finalized":
        return None
    if wanted == "finalized":
        return _SHUTDOWN[state]
    return (_UP if RESTING.index(state) < RESTING.index(wanted) else _DOWN)[state]
