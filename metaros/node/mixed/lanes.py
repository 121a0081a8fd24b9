"""The lane of a dedicated subscription's twin key, which takes what belongs there."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import zenoh

from metaros.node.mixed.twin_key import TwinKey

__all__ = ["handle_accepted", "run_accepted"]

Handle = Callable[[zenoh.Sample], Any]
Run = Callable[[list[zenoh.Sample]], None]


def handle_accepted(twin: TwinKey, handle: Handle) -> Handle:
    """`handle` for what belongs to the twin key."""

    def handle_if_accepted(sample: zenoh.Sample) -> Any:
        return handle(sample) if twin.accepts(sample) else None

    return handle_if_accepted


def run_accepted(twin: TwinKey, run: Run) -> Run:
    """The same for batches."""

    def run_if_accepted(batch: list[zenoh.Sample]) -> None:
        accepted = [sample for sample in batch if twin.accepts(sample)]
        if accepted:
            run(accepted)

    return run_if_accepted
