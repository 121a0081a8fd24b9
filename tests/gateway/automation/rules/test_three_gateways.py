"""Of three gateways on one store one fires schedules, and when it dies one of the others does: each time once."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from metaros.clock import ManualClock
from tests.gateway.automation.rules.test_scheduler import at, times
from tests.gateway.automation.rules.world import NOW, World, open_world


@pytest.mark.parametrize("store_url", ["postgres"], indirect=True)  # a file has one gateway
async def test_schedules_fire_once_whoever_dies(tmp_path: Path, store_url: str) -> None:
    clock = ManualClock(wall_ns=NOW)
    async with (
        open_world(tmp_path, url=store_url, clock=clock, name="a") as one,
        open_world(tmp_path, url=store_url, clock=clock, name="b") as two,
        open_world(tmp_path, url=store_url, clock=clock, name="c") as three,
    ):
        await one.put(at(expression="rate(1 minute)", misfire="all"))
        living = [one, two, three]
        for world in (two, three):
            await world.rules.registry.refresh()
        dead: list[World] = []
        for minute in range(15):
            if minute in (5, 10):  # whoever is on duty stands still for good
                (gone,) = [world for world in living if world.rules.scheduler.on_duty]
                living.remove(gone)
                dead.append(gone)
            for _ in range(4):
                clock.advance(15)
                await asyncio.gather(*(world.step(0) for world in living))
        found = await times(living[0])
        assert len(found) == len(set(found))
        assert len(found) >= 13
        assert len(dead) == 2
