"""Waits for what the graph is to have: a server, a node."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

from metaros.clock import SystemClock

__all__ = ["wait_in_graph"]

_PATIENCE_S: Final = 0.25  # between two looks at whether the context lives


def wait_in_graph(
    graph: Any, condition: Callable[[], bool], timeout_s: float | None, alive: Callable[[], bool]
) -> bool:
    """Wait for `condition()`, for so long (None: for ever) as `alive()`; whether it holds."""
    until_s = None if timeout_s is None else SystemClock.monotonic_s() + timeout_s
    while alive():
        left_s = _PATIENCE_S if until_s is None else min(_PATIENCE_S, until_s - SystemClock.monotonic_s())
        if graph.wait_for(condition, max(0.0, left_s)):
            return True
        if left_s <= 0:
            break
    return condition()
