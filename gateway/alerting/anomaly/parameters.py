"""The one parameter set of the streaming detectors."""

from __future__ import annotations

import math
from dataclasses import dataclass

__all__ = ["FIXED", "NOVELTIES", "THRESHOLD", "BankConfig"]

THRESHOLD = 0.5  # a score of at least this is an alert; the limits below are what it means
NOVELTIES = ("value", "profile", "range", "minimum")  # the order of every array with one column a novelty


@dataclass(frozen=True, slots=True, kw_only=True)
class BankConfig:
    """What makes a sample new, in standard deviations of its series so far.

    There is one limit, for every novelty: what is farther than so many standard deviations from all that was seen is
    an alert. docs/topics/anomaly.md says on which data it and the rest were chosen, and how little the rest matters.
    """

    limit: float = 0.33
    spacing: float = 0.2  # values nearer than this to a kept one are the same
    places: int = 128  # kept values per novelty, two guards included; a power of two
    spread_floor: float = 1e-3  # the least standard deviation, as a part of the values' size
    spread_share: float = 0.1  # and of any novelty, as a part of the values' deviation
    memory_samples: float = 1e6  # mean and deviation forget beyond this
    bin_s: float = 3600.0  # of the profile
    bins: int = 24
    profile_step: float = 0.3  # how much of its difference one more day moves an hour of the profile
    profile_learn_s: float = 172_800.0  # the profile says nothing before
    window_samples: int = 12  # range, and mean of what the value differs by from the profile, are over so many
    blocks: int = 8  # the lowest value is over so many windows, the current one included
    learn_samples: int = 150  # each novelty says nothing before it has seen so many
    learn_s: float = 600.0  # nor any of them before so much time has passed
    longest_step_s: float = 86_400.0  # a longer gap between two samples counts as this much time
    cooldown_samples: int = 24  # after an alert a series is quiet for so many samples
    cooldown_s: float = 60.0  # and for so long
    raised: float = 2.0  # an alert adds so many times the limit to it
    raised_samples: float = 200.0  # and after so many samples an e-th of that is left
    times: float = 1.0  # all limits times this; more is rarer

    def __post_init__(self) -> None:
        """Bounds that the arrays rely on.

        Raises:
            ValueError: names the field and what it must be.
        """
        if self.places < 8 or self.places & (self.places - 1):
            raise ValueError(f"places {self.places}: a power of two, at least 8")
        for name in ("limit", "spacing", "spread_floor", "spread_share", "bin_s", "times", "raised_samples"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} {getattr(self, name)}: more than 0")
        for name in ("bins", "window_samples", "blocks", "learn_samples", "memory_samples"):
            if not getattr(self, name) >= 2:
                raise ValueError(f"{name} {getattr(self, name)}: at least 2")

        if not 0.0 <= self.raised <= 1e6:
            raise ValueError(f"raised {self.raised}: 0 to a million")

    @property
    def raised_keeps(self) -> float:
        """What one sample leaves of the limits' raise."""
        return math.exp(-1.0 / self.raised_samples)


FIXED = BankConfig()
