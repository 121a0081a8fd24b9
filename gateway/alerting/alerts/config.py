"""How alerts behave in time: one frozen table, passed where a test wants another value."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["AlertConfig"]


@dataclass(frozen=True, slots=True, kw_only=True)
class AlertConfig:
    """Seconds, all of them."""

    clear_s: float = 30.0  # an alert resolves when all its findings have been over for so long
    cooldown_s: float = 600.0  # what begins again within so long after its end is the same alert
    grace_s: float = 120.0  # a finding from before a restart that is not told again for so long is over
    settle_s: float = 5.0  # a new value of a finding, no news beside it, is stored so often at most
    tick_s: float = 1.0
