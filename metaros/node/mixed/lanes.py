"""What comes by a twin key and does not pass the ingress: only what belongs there is taken."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import zenoh

from metaros.node.mixed.twin_key import TwinKey

__all__ = ["handle_accepted", "receive_accepted", "run_accepted"]

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


def receive_accepted(twin: TwinKey, receive: Callable[[], zenoh.Sample | None]) -> Callable[[], zenoh.Sample | None]:
    """The same for a channel's oldest sample."""

    def receive_if_accepted() -> zenoh.Sample | None:
        while (sample := receive()) is not None:
            if twin.accepts(sample):
                break
        return sample

    return receive_if_accepted
