"""Seconds made by hand, for tests of what judges them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from gateway.anomaly.cells import Second

__all__ = ["second"]


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
