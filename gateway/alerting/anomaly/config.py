"""The parameter set of the judge: its bounds, and the set of each of its parts."""

from __future__ import annotations

from dataclasses import dataclass, field

from gateway.anomaly.cohort import CohortConfig
from gateway.anomaly.lasting import LastingConfig
from gateway.anomaly.parameters import BankConfig
from gateway.anomaly.presence import PresenceConfig
from gateway.anomaly.rates import RateConfig
from gateway.anomaly.vector import VectorConfig

__all__ = ["JudgeConfig"]


@dataclass(frozen=True, slots=True, kw_only=True)
class JudgeConfig:
    """Series and robots beyond the bounds are refused, rows beyond theirs dropped; both are counted."""

    slots: int = 16_000
    slots_of_robot: int = 4_000  # no robot takes all of them
    robots: int = 2_000
    pending_rows: int = 2**20
    bank: BankConfig = field(default_factory=lambda: BankConfig(times=3.0))
    lasting: LastingConfig = field(default_factory=LastingConfig)
    presence: PresenceConfig = field(default_factory=PresenceConfig)
    rates: RateConfig = field(default_factory=RateConfig)
    vector: VectorConfig = field(default_factory=VectorConfig)
    cohort: CohortConfig = field(default_factory=CohortConfig)
    novel_s: float = 10.0  # a novelty is told when, within so long,
    novel_need: int = 3  # so many seconds in a row lie outside of all that was seen
