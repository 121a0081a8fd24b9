"""Which store is ours: kept over restarts, and never a reason to give up a link."""

from __future__ import annotations

import random  # noqa: TID251 - seeded

from edge_agent.state.store_id import StoreId
from tests.support.simulation.sim_disk import SimDisk


def test_it_is_kept() -> None:
    disk = SimDisk(random.Random(1))
    store = StoreId(disk)
    assert store.value == ""
    store.learn("hall-3")
    assert StoreId(disk).value == "hall-3"


def test_a_full_disk_is_tried_again_with_the_next_session() -> None:
    disk = SimDisk(random.Random(1), size_bytes=0)
    store = StoreId(disk)
    store.learn("hall-3")
    assert (store.value, StoreId(disk).value) == ("hall-3", "")
    disk.size_bytes = 1 << 20
    store.learn("hall-3")
    assert StoreId(disk).value == "hall-3"
