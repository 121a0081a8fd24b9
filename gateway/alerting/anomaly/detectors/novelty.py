"""Value novelty: the distinct values that were seen, kept sorted, and how far a new one is from all of them.

One sorted list for each novelty of each series, all in one array. A list begins with -inf and is filled up with +inf,
so that a search needs no bounds. A value enters if it is farther than the spacing from all others; in a full list the
two nearest then become one, and from then on only what is farther than they were may enter: a list settles.
"""

from __future__ import annotations

import numpy as np

from gateway.alerting.anomaly.detectors.state import Field, Floats, Rows, State
from gateway.alerting.anomaly.parameters import NOVELTIES, BankConfig

__all__ = ["SMALLEST_SPREAD", "evaluate", "fields", "insert", "learn", "least_spread"]

LISTS = len(NOVELTIES)
SMALLEST_SPREAD = 1e-100  # of a series that was always zero; keeps every ratio finite


def fields(config: BankConfig) -> tuple[Field, ...]:
    """What a series keeps of each novelty."""
    return (
        Field("kept", "f8", np.inf, (LISTS, config.places)),
        Field("size", "i8", 0, (LISTS,)),
        Field("gap", "f8", 0.0, (LISTS,)),  # between the two that became one last
        Field("seen", "f8", 0.0, (LISTS,)),
        Field("mean", "f8", 0.0, (LISTS,)),
        Field("square", "f8", 0.0, (LISTS,)),  # sum of squared deviations
    )


def _place(state: State, config: BankConfig, lists: Rows, values: Floats) -> Rows:
    """Where each value belongs in its list: an index into the flat array, of the first kept value not below it."""
    kept = state.flat["kept"]
    at = lists * config.places
    step = config.places // 2
    while step:
        at += step * (kept[at + (step - 1)] < values)
        step //= 2
    return at


def least_spread(state: State, config: BankConfig, rows: Rows) -> Floats:
    """What a series' differences are measured by at least: a part of the size or of the spread of its values.

    Else the rounding errors of a residual that was always zero would be something new, and whatever moves the range of
    a series that repeats itself.
    """
    first = rows * LISTS
    seen = np.maximum(state.flat["seen"][first], 1.0)
    spread = np.sqrt(state.flat["square"][first] / seen)
    size = np.abs(state.flat["mean"][first]) * config.spread_floor
    least: Floats = np.maximum(np.maximum(size, spread * config.spread_share), SMALLEST_SPREAD)
    return least


def evaluate(
    state: State, config: BankConfig, lists: Rows, values: Floats, least: Floats
) -> tuple[Rows, Floats, Floats, Floats]:
    """Each value before it is learned: its place, the nearest kept value, the distance to it, the spread."""
    at = _place(state, config, lists, values)
    kept = state.flat["kept"]
    below, above = kept[at - 1], kept[at]
    down, up = values - below, above - values
    nearest = np.where(down <= up, below, above)
    seen = np.maximum(state.flat["seen"][lists], 1.0)
    spread = np.sqrt(state.flat["square"][lists] / seen)
    return at, nearest, np.minimum(down, up), np.maximum(spread, least)


def learn(
    state: State, config: BankConfig, lists: Rows, values: Floats, at: Rows, distance: Floats, spread: Floats
) -> None:
    """Keep what is new, and move mean and spread."""
    new = np.flatnonzero(distance > np.maximum(spread * config.spacing, state.flat["gap"][lists]))
    if new.size:
        insert(state, config, lists[new], values[new], at[new])
    seen, square, mean = state.flat["seen"][lists], state.flat["square"][lists], state.flat["mean"][lists]
    remembered = seen < config.memory_samples
    square = np.where(remembered, square, square * (1.0 - 1.0 / config.memory_samples))
    seen = np.where(remembered, seen + 1.0, seen)
    delta = values - mean
    part = 1.0 / seen
    state.flat["seen"][lists] = seen
    state.flat["mean"][lists] = mean + delta * part
    state.flat["square"][lists] = square + delta * delta * (1.0 - part)


def insert(state: State, config: BankConfig, lists: Rows, values: Floats, at: Rows) -> None:
    """Put each value at its place; of a list that gets too full the two nearest become one."""
    kept = state["kept"].reshape(-1, config.places)
    index = np.arange(config.places)
    offset = (at - lists * config.places)[:, None]
    rows = np.take_along_axis(kept[lists], index - (index > offset), axis=1)
    rows[np.arange(len(lists)), offset[:, 0]] = values
    size = state.flat["size"][lists] + 1
    full = np.flatnonzero(size > config.places - 2)
    if full.size:
        rows[full], state.flat["gap"][lists[full]] = _merged(rows[full])
        size[full] -= 1
    kept[lists] = rows
    state.flat["size"][lists] = size


def _merged(rows: Floats) -> tuple[Floats, Floats]:
    """Full lists with their two nearest values as one, half-way; and how far apart these were."""
    count, places = rows.shape
    gaps = rows[:, 2:] - rows[:, 1:-1]
    nearest = gaps.argmin(axis=1)
    one = np.arange(count)
    rows[one, nearest + 1] = (rows[one, nearest + 1] + rows[one, nearest + 2]) * 0.5
    index = np.arange(places)
    index = index + (index > (nearest + 1)[:, None])
    merged = np.take_along_axis(rows, np.minimum(index, places - 1), axis=1)
    merged[:, -1] = np.inf
    return merged, gaps[one, nearest]
