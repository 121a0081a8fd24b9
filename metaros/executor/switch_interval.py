"""Python's thread switch interval: how long a computing thread may keep the GIL from one that waits.

Python's own interval of 5 ms would be added to every hand-over while a callback computes, so executors shorten it. A
program that set another one keeps it, and `METAROS_SWITCH_INTERVAL=off` keeps Python's.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from typing import Final

__all__ = ["SWITCH_INTERVAL_S", "shorten_switch_interval"]

SWITCH_INTERVAL_S: Final = 0.0005
_PYTHONS_OWN_S: Final = 0.005
_ours: set[float] = {_PYTHONS_OWN_S}  # values that no program chose


def shorten_switch_interval(interval_s: float, environ: Mapping[str, str] = os.environ) -> None:
    """Set it, for the whole process, unless it is shorter already or the program's own choice."""
    now_s = round(sys.getswitchinterval(), 9)
    if environ.get("METAROS_SWITCH_INTERVAL") == "off" or now_s not in _ours or now_s <= interval_s:
        return
    _ours.add(interval_s)
    sys.setswitchinterval(interval_s)
