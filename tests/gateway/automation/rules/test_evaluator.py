"""What is stored is judged in the transaction that stores it."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from metaros.clock import ManualClock
from tests.gateway.automation.rules.world import LAB, NOW, S, channel, open_world, rule
from tests.support.servers.databases import on_both

OFFLINE = {"detail-type": ["metaros.robot.offline"]}
LOW: dict[str, Any] = {"series": "battery_state.percentage", "below": 0.2}


@on_both
async def test_an_event_of_the_journal_sets_off_a_function(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.put(rule(pattern=OFFLINE))
        await world.emit("robot.online", hostname="bench")
        await world.emit("robot.offline")
        (one,) = await world.deliveries()
        assert (one["kind"], one["target"], one["robot"], one["happening"]) == ("function", "react", "r1", "e-2")
        event = one["payload"]
        assert (event["detail-type"], event["source"], event["detail"]) == (
            "metaros.robot.offline",
            "metaros",
            {"robot": "r1"},
        )
        assert event["resources"] == ["arn:metaros:robot:r1"]
        stats, groups = (await world.rules.registry.stats())["one"]
        assert (stats.matched, stats.fired, stats.errors, groups) == (1, 1, 0, 0)


@on_both
async def test_what_lasts_fires_by_its_timer_once(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        online = {"detail-type": ["metaros.robot.online"]}
        await world.put(rule(pattern=OFFLINE, until=online, when={"for": "60s"}))
        await world.emit("robot.offline", "r1")
        await world.emit("robot.offline", "r2")
        await world.step(30)
        await world.emit("robot.online", "r2")
        assert await world.fired() == 0
        await world.step(31)
        await world.step(61)
        assert [one["robot"] for one in await world.deliveries()] == ["r1"]


async def test_a_value_beyond_its_bound_fires_at_its_edge(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.put(rule(metric=LOW))
        await world.rows(0.5, 0.4, 0.19, 0.18, 0.3)
        await world.step(10)
        await world.rows(0.3, 0.15)
        await world.step(10)
        await world.rows(0.14, 0.13)
        found = await world.deliveries()
        assert [one["payload"]["detail"]["value"] for one in found] == [0.19, 0.15]
        assert found[0]["payload"]["detail-type"] == "metaros.metric.threshold"
        assert found[0]["payload"]["detail"]["series"] == "battery_state.percentage"


async def test_messages_are_decoded_for_the_rules_that_name_their_topic(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.put(
            rule(topic={"topic": "chatter"}, pattern={"detail": {"message": {"data": [{"prefix": "help"}]}}})
        )
        await world.messages(channel(), {"data": "hello"}, {"data": "help me"})
        await world.messages(channel(2, "/r1/other"), {"data": "help"})
        (one,) = await world.deliveries()
        detail = one["payload"]["detail"]
        assert (one["happening"], detail["message"], detail["topic"]) == (
            "r1/1/7/2",
            {"data": "help me"},
            "/r1/chatter",
        )


async def test_what_cannot_be_read_is_named(tmp_path: Path) -> None:
    async with open_world(tmp_path, rule_message_bytes=64) as world:
        await world.put(rule(topic={"topic": "**"}))
        await world.payloads(channel(1, "/r1/secret", encoding="sealed/cdr"), b"\1\2\3")
        await world.messages(channel(2, "/r1/long"), {"data": "x" * 200})
        found = [one["payload"]["detail"] for one in await world.deliveries()]
        assert [(one["omitted"]["reason"], "message" in one) for one in found] == [
            ("sealed", False),
            ("too_large", False),
        ]


async def test_a_rule_never_knows_of_robots_that_its_maker_did_not_see(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world:
        await world.put(rule(pattern={"source": ["metaros"]}), LAB)
        await world.put(rule("two", metric=LOW), LAB)
        await world.emit("robot.offline", "hall_1")
        await world.emit("rollout.changed", "")
        await world.rows(0.1, robot="hall_1")
        assert await world.fired() == 0
        await world.emit("robot.offline", "lab_1")
        await world.rows(0.1, robot="lab_1")
        assert {one["robot"] for one in await world.deliveries()} == {"lab_1"}


async def test_a_rules_mistake_ends_nothing_and_is_counted(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.put(rule("bad", pattern=OFFLINE, event_format="s3"))
        await world.put(rule("good", pattern=OFFLINE))
        await world.emit("robot.offline")
        assert await world.fired() == 1
        stats = (await world.rules.registry.stats())["bad"][0]
        assert (stats.errors, "recording.stored" in stats.error) == (1, True)


async def test_a_rule_that_changes_forgets_and_one_that_is_off_is_silent(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.put(rule(pattern=OFFLINE, when={"for": "10s"}))
        await world.emit("robot.offline")
        await world.put(rule(pattern=OFFLINE, when={"for": "20s"}))
        await world.step(11)
        assert await world.fired() == 0
        await world.emit("robot.offline")
        await world.rules.registry.enable("one", False, by="ada")
        await world.step(30)
        await world.emit("robot.offline")
        assert await world.fired() == 0


async def test_a_commit_that_fails_leaves_nothing_behind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with open_world(tmp_path) as world:
        await world.put(rule(metric=LOW))
        engine = world.rules.engine
        judged: list[int] = []
        real = engine.on_writes

        def failing(*args: Any) -> None:
            real(*args)
            judged.append(1)
            if len(judged) == 1:
                raise RuntimeError("the disk is gone")

        monkeypatch.setattr(engine, "on_writes", failing)
        await world.rows(0.1)
        assert await world.fired() == 0
        world.seqs[0] = 0  # its robot sends it again
        await world.rows(0.1)
        assert await world.fired() == 1


async def test_what_did_not_come_for_a_while_is_missed(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.put(rule(topic={"topic": "chatter"}, when={"absent_for": "10s"}))
        for _ in range(3):
            await world.messages(channel(), {"data": "here"})
            await world.step(6)
        assert await world.fired() == 0
        await world.step(6)
        await world.step(60)
        (one,) = await world.deliveries()
        assert one["payload"]["detail"]["seq"] == 3
        assert one["payload"]["detail"]["stamp_ns"] <= world.clock.wall_ns() - 10 * S


async def test_a_rule_has_so_many_groups_and_no_more(tmp_path: Path) -> None:
    async with open_world(tmp_path, rule_groups=2) as world:
        await world.put(rule(pattern=OFFLINE, when={"for": "10s"}))
        for robot in ("r1", "r2", "r3"):
            await world.emit("robot.offline", robot)
        stats, groups = (await world.rules.registry.stats())["one"]
        assert (stats.errors, stats.error, groups) == (1, "it has 2 groups already", 2)
        await world.step(11)
        assert {one["robot"] for one in await world.deliveries()} == {"r1", "r2"}


@on_both
async def test_what_was_committed_was_judged_before_the_gateway_died(tmp_path: Path, store_url: str) -> None:
    clock = ManualClock(wall_ns=NOW)
    async with open_world(tmp_path, url=store_url, clock=clock) as world:
        await world.put(rule(metric=LOW, when={"for": "10s"}))
        await world.rows(0.1)
    clock.advance(60)
    async with open_world(tmp_path, url=store_url, clock=clock) as world:
        assert await world.fired() == 0
        await world.step(0)  # the timer of the former life
        await world.step(60)
        assert await world.fired() == 1


@pytest.mark.parametrize("store_url", ["postgres"], indirect=True)  # a file has one gateway
async def test_rules_of_two_gateways_remember_together(tmp_path: Path, store_url: str) -> None:
    async with (
        open_world(tmp_path, url=store_url, name="a") as one,
        open_world(tmp_path, url=store_url, name="b") as two,
    ):
        await one.put(rule(pattern=OFFLINE, when={"rate": {"count": 4, "within": "60s"}}))
        await two.rules.registry.refresh()
        await asyncio.gather(*(world.emit("robot.offline") for world in (one, two)))
        await asyncio.gather(*(world.emit("robot.offline") for world in (one, two)))
        assert await one.fired() == 1
