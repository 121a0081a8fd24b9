"""The one parameter set of the streaming detectors."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FIXED", "NOVELTIES", "THRESHOLD", "BankConfig"]

THRESHOLD = 0.5  # a score of at least this is an alert; the limits below are what it means
NOVELTIES = ("value", "profile", "minimum")  # the order of every array with one column a novelty


@dataclass(frozen=True, slots=True, kw_only=True)
class BankConfig:
    """What makes a sample new, in standard deviations of its series so far.

    Limits, spacing and blocks were tuned on the 35 development series of NAB (docs/topics/anomaly.md says how); the
    rest is bounds. A limit L means: a value farther than L standard deviations from every value seen is an alert.
    """

    value_limit: float = 0.33  # the value itself
    profile_limit: float = 2.0  # the value less what is usual at this hour of the day
    minimum_limit: float = 1.0  # the lowest value of the last samples
    spacing: float = 0.2  # values nearer than this to a kept one are the same
    places: int = 128  # kept values per novelty, two guards included; a power of two
    spread_floor: float = 1e-3  # the least standard deviation, as a part of the values' size or deviation
    memory_samples: float = 1e6  # mean and deviation forget beyond this
    bin_s: float = 3600.0  # of the profile
    bins: int = 24
    profile_step: float = 0.3  # how much of its difference one more day moves an hour of the profile
    profile_learn_s: float = 172_800.0  # the profile says nothing before
    block_samples: int = 12  # the lowest value is taken over `blocks` of these, the current one included
    blocks: int = 8
    learn_samples: int = 150  # each novelty says nothing before it has seen so many
    learn_s: float = 600.0  # nor any of them before so much time has passed
    longest_step_s: float = 86_400.0  # a longer gap between two samples counts as this much time
    cooldown_samples: int = 24  # after an alert a series is quiet for so many samples
    cooldown_s: float = 60.0  # and for so long
    times: float = 1.0  # all limits times this; more is rarer

    def __post_init__(self) -> None:
        """Bounds that the arrays rely on.

        Raises:
            ValueError: names the field and what it must be.
        """
        if self.places < 8 or self.places & (self.places - 1):
            raise ValueError(f"places {self.places}: a power of two, at least 8")
        for name in ("value_limit", "profile_limit", "minimum_limit", "spacing", "spread_floor", "bin_s", "times"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} {getattr(self, name)}: more than 0")
        for name in ("bins", "block_samples", "blocks", "learn_samples", "memory_samples"):
            if not getattr(self, name) >= 2:
                raise ValueError(f"{name} {getattr(self, name)}: at least 2")

    @property
    def limits(self) -> tuple[float, float, float]:
        """In the order of NOVELTIES."""
        return self.value_limit, self.profile_limit, self.minimum_limit


FIXED = BankConfig()
