"""The byte budget that an operator set."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded

import pytest

from edge_agent.errors import DiskFullError
from edge_agent.link.budget import Budget
from edge_agent.link.byte_budget_override import UplinkLimit, stored_limit
from metaros.clock import ManualClock
from metaros.errors import UsageError
from tests.support.simulation.sim_disk import SimDisk


def rig() -> tuple[SimDisk, Budget, UplinkLimit]:
    disk, clock = SimDisk(random.Random(1)), ManualClock()
    budget = Budget(now_s=clock.monotonic_s())
    return disk, budget, UplinkLimit(disk, budget, clock)


async def test_it_is_in_force_and_kept() -> None:
    disk, budget, limit = rig()
    assert stored_limit(disk) == 0
    await limit.set(50_000)
    assert (budget.limit_bytes_per_s, stored_limit(disk)) == (50_000, 50_000)
    await limit.set(0)
    assert (budget.limit_bytes_per_s, stored_limit(disk)) == (0, 0)


async def test_the_last_one_wins() -> None:
    disk, budget, limit = rig()
    await asyncio.gather(*(limit.set(1000 * number) for number in range(1, 20)))
    assert (budget.limit_bytes_per_s, stored_limit(disk)) == (19_000, 19_000)


async def test_too_little_is_refused() -> None:
    disk, budget, limit = rig()
    with pytest.raises(UsageError, match="below the least"):
        await limit.set(999)
    assert (budget.limit_bytes_per_s, stored_limit(disk)) == (0, 0)


async def test_on_a_full_disk_it_is_in_force_and_says_that_it_is_not_kept() -> None:
    disk, budget, limit = rig()
    disk.size_bytes = 0
    with pytest.raises(DiskFullError):
        await limit.set(50_000)
    assert (budget.limit_bytes_per_s, stored_limit(disk)) == (50_000, 0)


@pytest.mark.parametrize("text", [b"", b"{", b"[]", b'{"bytes_per_s": "x"}', b'{"bytes_per_s": -5}', b"\xff"])
def test_a_damaged_file_is_no_limit(text: bytes) -> None:
    disk, _, _ = rig()
    disk.files["uplink.json"] = text
    assert stored_limit(disk) == 0
