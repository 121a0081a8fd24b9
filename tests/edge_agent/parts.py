"""Parts of an agent for tests: an outbox on a disk in memory, and what is flushed of it."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from typing import Any

from edge_agent.outbox import LOGS, ClassPolicy, Outbox, Taken, run_steps, steps
from metaros.clock import Clock, ManualClock
from tests.support.simulation.sim_disk import SimDisk

__all__ = ["accept", "make_outbox", "policies", "taken"]

MIB = 1024 * 1024


def policies(*, event: int = 16 * MIB, metric: int = 16 * MIB, bulk: int = 256 * MIB) -> dict[str, ClassPolicy]:
    """The three classes with these quotas, flushed whenever somebody asks."""
    return {
        "event": ClassPolicy(quota_bytes=event, when_full="refuse", sync_s=0.0, sync_bytes=1),
        "metric": ClassPolicy(quota_bytes=metric, when_full="thin", sync_s=0.0, sync_bytes=1),
        "bulk": ClassPolicy(quota_bytes=bulk, when_full="drop", sync_s=0.0, sync_bytes=1),
    }


def make_outbox(disk: SimDisk | None = None, clock: Clock | None = None, *, seed: int = 1, **more: Any) -> Outbox:
    """An outbox on `disk`, a fresh one where none is given; `seed` makes its epochs."""
    rng = random.Random(seed)
    more.setdefault("classes", policies())
    return Outbox(
        SimDisk(rng) if disk is None else disk,
        clock or ManualClock(),
        new_epoch=lambda: rng.getrandbits(64),
        writer=f"{rng.getrandbits(64):016x}",
        **{"reserve_bytes": 64 * 1024, **more},
    )


def accept(outbox: Outbox) -> None:
    """Flush everything, in this thread."""
    for name in LOGS:
        run_steps(steps(outbox, outbox._disk, name))


def taken(outbox: Outbox, name: str) -> list[Taken]:
    """Everything that a log has to send."""
    accept(outbox)
    return list(iter(lambda: outbox.take(name), None))
