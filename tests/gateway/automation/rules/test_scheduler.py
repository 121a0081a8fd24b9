"""Schedules fire once for each of their times, whoever was there; what was missed goes by the rule's wish."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.automation.rules import scheduler
from gateway.automation.rules.document import read_rule
from gateway.automation.rules.scheduler import RuleScheduler, missed
from gateway.errors import StoreError
from metaros.clock import ManualClock
from tests.gateway.automation.rules.world import ADMIN, NOW, S, World, open_world, rule
from tests.support.servers.databases import on_both

HOUR = 3600


def at(**schedule: Any) -> dict[str, Any]:
    """A rule that fires by itself."""
    return rule(schedule={"expression": "rate(1 hour)", **schedule})


async def times(world: World) -> list[str]:
    """Of what fired."""
    return [one["payload"]["time"] for one in await world.deliveries()]


@on_both
async def test_a_schedule_fires_at_its_times_once(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.put(at(expression="cron(0/10 * * * ? *)"))
        await world.step(0)
        for _ in range(20):
            await world.step(60)
        found = await world.deliveries()
        assert [one["payload"]["time"][13:] for one in found] == [":20:00Z", ":30:00Z"]
        assert len({one["happening"] for one in found}) == 2
        assert found[0]["payload"]["detail-type"] == "metaros.schedule"


@pytest.mark.parametrize(("misfire", "count"), [("skip", 0), ("once", 1), ("all", 5)])
async def test_what_nobody_was_there_for(tmp_path: Path, misfire: str, count: int) -> None:
    clock = ManualClock(wall_ns=NOW)
    async with open_world(tmp_path, clock=clock) as world:
        await world.put(at(misfire=misfire))
        await world.step(0)
    clock.advance(5 * HOUR + 600)
    async with open_world(tmp_path, clock=clock) as world:
        await world.step(0)
        assert await world.fired() == count
        await world.step(HOUR)
        assert await world.fired() >= count  # and goes on
        fire = (await world.rules.scheduler.next_fires())["one"]
        assert clock.wall_ns() < fire.next_ns <= clock.wall_ns() + HOUR * S


@pytest.mark.parametrize("store_url", ["postgres"], indirect=True)  # a file has one gateway
async def test_of_two_gateways_one_fires(tmp_path: Path, store_url: str) -> None:
    clock = ManualClock(wall_ns=NOW)
    async with (
        open_world(tmp_path, url=store_url, clock=clock, name="a") as one,
        open_world(tmp_path, url=store_url, clock=clock, name="b") as two,
    ):
        await one.put(at())
        await two.rules.registry.refresh()
        await asyncio.gather(one.step(0), two.step(0))
        assert [one.rules.scheduler.on_duty, two.rules.scheduler.on_duty].count(True) == 1
        fire = (await one.rules.scheduler.next_fires())["one"]
        clock.advance((fire.next_ns - clock.wall_ns()) / S + 1)
        await asyncio.gather(one.step(0), two.step(0))
        assert await one.fired() == 1


@pytest.mark.parametrize("store_url", ["postgres"], indirect=True)  # a file has one gateway
async def test_who_lost_its_duty_without_knowing_fires_nothing_twice(
    tmp_path: Path, store_url: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A gateway that stood still may believe to be on duty while another one is: both fire, and once."""

    async def on_duty(scheduler: RuleScheduler) -> bool:
        return True

    monkeypatch.setattr(RuleScheduler, "_take_duty", on_duty)
    clock = ManualClock(wall_ns=NOW)
    async with (
        open_world(tmp_path, url=store_url, clock=clock, name="a") as one,
        open_world(tmp_path, url=store_url, clock=clock, name="b") as two,
    ):
        await one.put(at(expression="rate(1 minute)"))
        await two.rules.registry.refresh()
        await asyncio.gather(one.step(0), two.step(0))
        for _ in range(10):
            clock.advance(60)
            await asyncio.gather(one.step(0), two.step(0))
        found = await times(one)
        assert len(found) == len(set(found)) == 10


@pytest.mark.parametrize("store_url", ["postgres"], indirect=True)  # a file has one gateway
async def test_another_gateways_rule_is_gone_by_here_too(tmp_path: Path, store_url: str) -> None:
    async with (
        open_world(tmp_path, url=store_url, name="a") as one,
        open_world(tmp_path, url=store_url, name="b") as two,
    ):
        await one.put(rule(pattern={"detail-type": ["metaros.robot.offline"]}))
        await two.rules.registry.refresh()
        await two.emit("robot.offline")
        assert await one.fired() == 1
        await one.rules.registry.remove("one", by="ada")
        await two.rules.registry.refresh()
        await two.emit("robot.offline")
        assert await one.fired() == 1


async def test_a_schedule_that_is_changed_or_off_does_not_fire_at_its_old_times(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world:
        await world.put(at())
        await world.step(0)
        await world.put(at(expression="rate(1 day)"))
        await world.step(2 * HOUR)
        assert await world.fired() == 0
        await world.rules.registry.enable("one", False, by="ada")
        await world.step(48 * HOUR)
        assert await world.fired() == 0
        await world.rules.registry.remove("one", by="ada")
        await world.step(48 * HOUR)
        assert await world.fired() == 0


async def test_while_the_store_is_away_schedules_wait(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    asked: list[int] = []
    twice = asyncio.Event()

    class Away:
        """A shared store that answers again the second time."""

        shared, gateway_id = True, "a"

        async def run(self, _job: Any) -> bool:
            """Another gateway has the duty."""
            asked.append(len(asked))
            if len(asked) == 1:
                raise StoreError("it is away")
            twice.set()
            return False

    monkeypatch.setattr(scheduler, "LOOK_S", 0.0)
    caplog.set_level(logging.DEBUG, "gateway.automation.rules.scheduler")
    database: Any = Away()
    made = RuleScheduler(database, SimpleNamespace(listeners=[]), None, clock=ManualClock(wall_ns=NOW))  # type: ignore[arg-type]
    task = asyncio.create_task(made.run())
    async with asyncio.timeout(60):
        await twice.wait()
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    assert [(one.levelname, one.getMessage()) for one in caplog.records] == [
        ("DEBUG", "schedules and timers wait for the store: it is away")
    ]
    assert not made.on_duty


def test_years_of_minutes_are_passed_in_one_step() -> None:
    document = at(expression="rate(1 minute)", misfire="all")
    made = read_rule(document, maker=_maker())
    found, following = missed(made, NOW - 400 * 86_400 * S, NOW, most=100)
    assert 100 <= len(found) <= 102
    assert NOW < following <= NOW + 60 * S


def _maker() -> Any:
    from gateway.domain.automation.rule import Maker

    return Maker.of(ADMIN)
