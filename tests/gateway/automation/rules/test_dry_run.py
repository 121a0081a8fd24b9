"""A dry run finds in the past what the rule would have found when it happened."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from gateway.automation.rules.document import read_rule
from gateway.automation.rules.dry_run import DryRun
from gateway.domain.automation.rule import Maker
from tests.gateway.automation.rules.world import ADMIN, LAB, S, World, channel, open_world, rule
from tests.support.servers.databases import on_both


async def tried(world: World, maker: Any = ADMIN, **fields: Any) -> DryRun:
    """What a rule would have done in the last hours."""
    now_ns = world.clock.wall_ns()
    made = read_rule(rule(**fields), maker=Maker.of(maker))
    return await world.rules.dry_runs.run(made, from_ns=now_ns - 7200 * S, until_ns=now_ns + 4000 * S, most_firings=100)


@on_both
async def test_of_the_journal_with_a_memory(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        for robot, seconds in (("r1", 100), ("r2", 10)):
            await world.emit("robot.offline", robot)
            await world.step(seconds)
            await world.emit("robot.online", robot)
        offline, online = [{"detail-type": [f"metaros.robot.{word}"]} for word in ("offline", "online")]
        done = await tried(world, pattern=offline, until=online, when={"for": "60s"})
        assert (done.scanned, done.matched, done.fired, done.cut) == (4, 2, 1, False), done
        (firing,) = done.firings
        assert (firing.robot, firing.event_id, firing.payloads[0][:2]) == ("r1", "e-1", ("call", "function"))
        assert (await tried(world, LAB, pattern=offline)).matched == 0
        assert await world.fired() == 0


@pytest.mark.parametrize("when", [None, {"hysteresis": {"enter": 0.2, "exit": 0.4}}])
async def test_of_values(tmp_path: Path, when: Any) -> None:
    async with open_world(tmp_path) as world:
        await world.rows(0.5, 0.19, 0.3, 0.15, 0.5, 0.1)
        metric = {"series": "battery_state.percentage", "below": 0.2}
        done = await tried(world, metric=metric, **({"when": when} if when else {}))
        assert (done.scanned, done.fired) == (6, 2 if when else 3)


async def test_of_messages(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world:
        await world.messages(channel(), {"data": "hello"}, {"data": "help"}, {"data": "help again"})
        pattern = {"detail": {"message": {"data": [{"prefix": "help"}]}}}
        done = await tried(world, topic={"topic": "chatter"}, pattern=pattern)
        assert (done.scanned, [one.event_id for one in done.firings]) == (3, ["r1/1/7/2", "r1/1/7/3"])


async def test_of_a_schedule(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world:
        done = await tried(world, schedule={"expression": "rate(30 minutes)"})
        assert done.fired == 6


async def test_it_is_bounded(tmp_path: Path) -> None:
    async with open_world(tmp_path, rule_dry_rows=512) as world:
        await world.rows(*[float(number % 2) for number in range(2000)])
        done = await tried(world, metric={"series": "battery_state.percentage", "above": 0.5}, when={"cooldown": "1s"})
        assert done.cut
        assert done.scanned <= 1024
        assert len(done.firings) == 100
