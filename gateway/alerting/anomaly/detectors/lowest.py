"""The lowest value of the last samples, by blocks: what a spike cannot lift, and a lasting rise does."""

from __future__ import annotations

import numpy as np

from gateway.alerting.anomaly.detectors.state import Field, Floats, Rows, State
from gateway.alerting.anomaly.parameters import BankConfig

__all__ = ["fields", "lowest"]


def fields(config: BankConfig) -> tuple[Field, ...]:
    """The lowest value of each finished block, and the block under way."""
    return (
        Field("block_lowest", "f8", -np.inf, (config.blocks - 1,)),
        Field("block_next", "i8"),
        Field("block_now", "f8", np.inf),
        Field("block_count", "i8"),
    )


def lowest(state: State, config: BankConfig, rows: Rows, values: Floats) -> Floats:
    """The lowest value of the last `blocks` blocks, the new values included; -inf until there are so many."""
    now = np.minimum(state["block_now"][rows], values)
    count = state["block_count"][rows] + 1
    found: Floats = np.minimum(state["block_lowest"][rows].min(axis=1), now)
    full = np.flatnonzero(count == config.window_samples)
    if full.size:
        done = rows[full]
        following = state["block_next"][done]
        state["block_lowest"][done, following] = now[full]
        state["block_next"][done] = (following + 1) % (config.blocks - 1)
        now[full] = np.inf
        count[full] = 0
    state["block_now"][rows] = now
    state["block_count"][rows] = count
    return found
