"""The last values of a series: their range, and the mean of what they differ by from the profile."""

from __future__ import annotations

import numpy as np

from gateway.alerting.anomaly.detectors.state import Field, Floats, Rows, State
from gateway.alerting.anomaly.parameters import BankConfig

__all__ = ["fields", "of", "range_with"]


def fields(config: BankConfig) -> tuple[Field, ...]:
    """The last values and differences, each in a ring."""
    return (
        Field("recent", "f8", np.nan, (config.window_samples,)),
        Field("differences", "f8", np.nan, (config.window_samples,)),
        Field("recent_next", "i8"),
    )


def of(state: State, config: BankConfig, rows: Rows, values: Floats, differences: Floats) -> tuple[Floats, Floats]:
    """Mean of the differences and range of the values, the new ones included; NaN until all are known."""
    at = state["recent_next"][rows]
    state["recent"][rows, at] = values
    state["differences"][rows, at] = differences
    state["recent_next"][rows] = (at + 1) % config.window_samples
    recent = state["recent"][rows]
    # One after the other, or the rounding would differ from stream.py's.
    mean: Floats = np.add.accumulate(state["differences"][rows], axis=1)[:, -1] / config.window_samples
    wide: Floats = recent.max(axis=1) - recent.min(axis=1)
    return mean, wide


def range_with(state: State, row: int, value: float) -> float:
    """Of a row's last values as they are and one more; NaN until all are known."""
    recent = np.append(state["recent"][row], value)
    return float(recent.max() - recent.min())
