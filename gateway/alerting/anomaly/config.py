"""The parameter set of the evaluator: its bounds, and the set of each of its parts."""

from __future__ import annotations

from dataclasses import dataclass, field

from gateway.alerting.anomaly.detectors.cohort import CohortConfig
from gateway.alerting.anomaly.detectors.lasting import LastingConfig
from gateway.alerting.anomaly.detectors.presence import PresenceConfig
from gateway.alerting.anomaly.detectors.rates import RateConfig
from gateway.alerting.anomaly.detectors.vector import VectorConfig
from gateway.alerting.anomaly.parameters import BankConfig

__all__ = ["EvaluatorConfig"]


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluatorConfig:
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
