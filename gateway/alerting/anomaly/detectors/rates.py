"""Too slow or too often, against the rate that was learnt; only of what is steady. Rows are topics or series."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gateway.alerting.anomaly.checks import Check, CheckTable
from gateway.alerting.anomaly.condition_states import PENDING, ConditionStates
from gateway.alerting.anomaly.defaults import DEFAULT_CHECKS
from gateway.alerting.anomaly.detectors.columns import Bools, Columns, Floats, Ints

__all__ = ["RATE_SERIES", "RateConfig", "RateVerdict", "Rates", "rate_series", "topic_of_rate"]


RATE_SERIES = "topic_rates."  # before the name of a topic, with dots: its rate as the agent counts it


def rate_series(topic: str) -> str:
    """The series of a topic's rate."""
    return RATE_SERIES + topic.strip("/").replace("/", ".")


def topic_of_rate(series: str) -> str:
    """The topic whose rate a series is; names of topics have no dots."""
    return "/" + series.removeprefix(RATE_SERIES).replace(".", "/")


@dataclass(frozen=True, slots=True, kw_only=True)
class RateConfig:
    """The one parameter set. What is too slow and too fast is said by the table of checks."""

    learn: int = 120  # seconds with rows
    least_hz: float = 2.0  # what is slower is judged by silence alone
    steady: float = 0.25  # mean distance to the rate, as a part of it; beyond, nothing is judged
    memory: int = 600
    stuck: float = 0.1  # how much slower a breach is learnt: what lasts for hours is how it is now


@dataclass(frozen=True, slots=True)
class RateVerdict:
    """Rows where something opened or closed: what is now, and what is usual."""

    rows: Ints
    opened: Bools
    now_hz: Floats
    usual_hz: Floats


class Rates:
    """Learnt rates, a row each."""

    def __init__(self, config: RateConfig = RateConfig()) -> None:
        self.config = config
        self.set_checks(CheckTable(DEFAULT_CHECKS))
        zero = np.float64(0)
        self.columns = Columns(usual=zero, fast=zero, wobble=zero, seen=np.int64(0))
        self.low, self.high = ConditionStates(), ConditionStates()

    def set_checks(self, table: CheckTable) -> None:
        """Judge by these checks from now on; their `low` and `high` are factors of the learnt rate."""
        self._limits = table.get("rate_low"), table.get("rate_high")

    def accept(self, row: int, hz: float) -> None:
        """This is the usual rate."""
        self.columns["usual"][row], self.columns["wobble"][row] = hz, 0.0
        for holds in (self.low, self.high):
            holds.columns.reset(row)

    @property
    def parts(self) -> dict[str, Columns]:
        """All columns by name."""
        return {"rates": self.columns, "low": self.low.columns, "high": self.high.columns}

    def feed(self, rows: Ints, hz: Floats, at_s: float) -> tuple[RateVerdict, RateVerdict]:
        """Judge and learn one second's rates; too slow, too often."""
        config, columns = self.config, self.columns
        fast = columns["fast"][rows] + 0.5 * (hz - columns["fast"][rows])
        usual, seen, wobble = columns["usual"][rows], columns["seen"][rows], columns["wobble"][rows]
        judged = (usual >= config.least_hz) & (seen > config.learn) & (wobble <= config.steady * usual)
        verdicts, breached = [], np.zeros(len(rows), np.bool_)
        for holds, check in zip((self.low, self.high), self._limits, strict=True):
            over = _beyond(check, fast, usual)
            for_s, clear_s = (np.full(len(rows), wait) for wait in ((check.for_s, check.clear_s) if check else (0, 0)))
            opened, cleared = holds.step(rows, judged & over, ~over, at_s, for_s=for_s, clear_s=clear_s)
            edge = opened | cleared
            verdicts.append(RateVerdict(rows[edge], opened[edge], fast[edge], usual[edge]))
            breached |= holds.columns["state"][rows] >= PENDING
        rate = np.maximum(1.0 / (seen + 1.0), 1.0 / config.memory) * np.where(breached, config.stuck, 1.0)
        columns["fast"][rows] = fast
        columns["usual"][rows] = usual + rate * (hz - usual)
        columns["wobble"][rows] = wobble + rate * (np.abs(hz - usual) * (seen > 0) - wobble)
        columns["seen"][rows] = seen + (hz > 0.0)
        return verdicts[0], verdicts[1]


def _beyond(check: Check | None, hz: Floats, usual_hz: Floats) -> Bools:
    beyond = np.zeros(len(hz), np.bool_)
    if check is not None and check.low is not None:
        beyond |= hz < check.low * usual_hz
    if check is not None and check.high is not None:
        beyond |= hz > check.high * usual_hz
    return beyond
