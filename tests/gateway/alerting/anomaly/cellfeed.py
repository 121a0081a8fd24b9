"""Seconds made by hand, for tests of what judges them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from gateway.alerting.anomaly.detectors.cells import Second
from gateway.alerting.anomaly.detectors.lasting import LastingConfig

__all__ = ["quick", "second"]

TIMES = 4


def quick(config: LastingConfig) -> LastingConfig:
    """The same over windows of a quarter of the length, learnt and forgotten in a quarter of the time."""
    return replace(
        config,
        window=tuple(max(1, window // TIMES) for window in config.window),
        learn_s=config.learn_s // TIMES,
        epoch_s=config.epoch_s // TIMES,
        adopt_s=config.adopt_s // TIMES,
        memory_s=config.memory_s // TIMES,
    )


def second(
    at_s: float,
    values: Sequence[float],
    *,
    slots: Sequence[int] | None = None,
    count: int = 1,
    spread: float | Sequence[float] = 0.0,
) -> Second:
    """One cell a slot, all of its rows alike but for the spread."""
    mean = np.array(values, np.float64)
    wide = np.full(len(mean), spread)
    numbers = np.arange(len(mean)) if slots is None else np.array(slots)
    return Second(
        at_s, numbers, np.full(len(mean), float(count)), mean, mean - wide, mean + wide, mean, wide, mean,
        np.full(len(mean), at_s + 0.5),
    )  # fmt: skip
