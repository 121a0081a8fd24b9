"""What is usual at an hour of the day, and how far a value is from it: the residual that the profile novelty judges."""

from __future__ import annotations

import numpy as np

from gateway.alerting.anomaly.detectors.state import Field, Floats, Rows, State
from gateway.alerting.anomaly.parameters import BankConfig

__all__ = ["fields", "usual"]


def fields(config: BankConfig) -> tuple[Field, ...]:
    """The mean of each hour over the days before, and the hour that is under way."""
    return (
        Field("usual", "f8", np.nan, (config.bins,)),
        Field("bin", "i8", -1),
        Field("bin_sum", "f8"),
        Field("bin_count", "f8"),
    )


def usual(state: State, config: BankConfig, rows: Rows, stamps_s: Floats, values: Floats) -> Floats:
    """What was usual at each stamp's hour before today, NaN where that hour is new; then learns the values.

    An hour moves the profile as a whole, when it is over: how many samples it had does not matter.
    """
    day_s = config.bin_s * config.bins
    now = np.minimum((np.mod(stamps_s, day_s) / config.bin_s).astype(np.int64), config.bins - 1)
    before = state["bin"][rows]
    changed = np.flatnonzero(now != before)
    if changed.size:
        _finish(state, config, rows[changed], before[changed])
        state["bin"][rows[changed]] = now[changed]
    state["bin_sum"][rows] += values
    state["bin_count"][rows] += 1.0
    known: Floats = state["usual"][rows, now]
    return known


def _finish(state: State, config: BankConfig, rows: Rows, bins: Rows) -> None:
    """The hour that is over moves the profile; a first one is it."""
    known = bins >= 0
    done, hour = rows[known], bins[known]
    mean = state["bin_sum"][done] / state["bin_count"][done]
    old = state["usual"][done, hour]
    state["usual"][done, hour] = np.where(np.isnan(old), mean, old + config.profile_step * (mean - old))
    state["bin_sum"][rows] = 0.0
    state["bin_count"][rows] = 0.0
