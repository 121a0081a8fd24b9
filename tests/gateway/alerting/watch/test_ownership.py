"""Robots go from one gateway to another, die with one, or come nowhere: their detectors and alerts go on."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from gateway.alerting.watch import ownership as module
from gateway.alerting.watch.ownership import Ownership
from gateway.alerting.watch.remote_watch import RemoteWatch, answers
from gateway.cluster.errors import PeerGoneError
from gateway.errors import StoreError
from gateway.store.alerting.watch_states import Saved, read_state, take_states
from gateway.store.engine import StoreEngine
from metaros.clock import ManualClock
from tests.gateway.alerting.watch.replicas import open_replicas
from tests.support.gateways.fake_mesh import FakeMeshes
from tests.support.servers.postgres import PostgresServer

LEARN_S = 60


async def test_a_robot_that_moves_is_judged_by_one_at_a_time_and_goes_on_to_the_last_bit(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    async with (
        open_replicas(tmp_path / "one", postgres.schema(), "z") as calm,
        open_replicas(tmp_path / "many", postgres.schema(), "a", "b", "c") as moving,
    ):
        calm.link("r1", "z")
        moving.link("r1", "a")
        moving.link("r2", "b")
        for home, seconds in (("a", LEARN_S), ("b", 10), ("c", 10), ("a", 10)):
            moving.link("r1", home)
            await moving.run(seconds, robots=("r1", "r2"), at_once=20 if seconds == LEARN_S else 2)
            assert moving.judges("r1") == [home]
            assert moving.judges("r2") == ["b"]
        await calm.run(LEARN_S + 30, at_once=20)
        assert moving.judged("a") == calm.judged("z")
        assert moving.judged("a")["imu.x"][3] == 40
        moving.link("r1", "c")
        await moving.run(20, shift=60.0, robots=("r1", "r2"), at_once=2)
        await calm.run(20, shift=60.0, at_once=2)
        theirs = {(edge.finding.key, edge.change) for edge in calm.by_name["z"].edges}
        ours = [(edge.finding.key, edge.change) for one in moving.by_name.values() for edge in one.edges]
        assert {key for key in ours if key[0][0] == "r1" and key[0][2] != "link_flaps"} == theirs
        assert len(theirs) > 2
        assert moving.judged("c") == calm.judged("z")


async def test_after_a_kill_the_new_home_finds_what_came_meanwhile_and_alerts_of_nothing_twice(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    async with open_replicas(tmp_path, postgres.schema(), "a", "b") as world:
        world.link("r1", "a")
        await world.run(LEARN_S, at_once=20)
        await world.run(12, shift=60.0)  # hot, and told
        assert world.opened()["r1", "heat"] == 1
        before = {alert.cause: alert for alert in await world.alerts()}
        a, b = world.by_name["a"], world.by_name["b"]
        for second in range(world.second, world.second + 5):  # stored, and never judged by a: it is cool again
            world.submit("r1", "a", second=second)
        await a.stored()
        world.second += 5
        world.clock.advance(5.0)
        a.alive = False
        world.link("r1", "b")
        assert world.judges("r1") == []
        await world.run(15)
        assert world.judges("r1") == ["b"]
        assert b.watch.describe()["replayed_rows"] >= 5 * 8
        after = {alert.cause: alert for alert in await world.alerts()}
        assert after["heat"].id == before["heat"].id
        assert after["heat"].times == before["heat"].times == 1
        assert sum(alert.cause == "heat" for alert in await world.alerts()) == 1
        assert world.opened()["r1", "heat"] == 1
        await world.run(60, at_once=3)
        assert {alert.cause: alert.state for alert in await world.alerts()}["heat"] == "resolved"
        reported = [
            what for what, alert in (*a.told, *b.told) if alert.cause == "heat" and what in ("opened", "resolved")
        ]
        assert reported == ["opened", "resolved"]


async def test_what_goes_on_after_a_kill_stays_the_same_open_alert(tmp_path: Path, postgres: PostgresServer) -> None:
    async with open_replicas(tmp_path, postgres.schema(), "a", "b") as world:
        world.link("r1", "a")
        await world.run(LEARN_S, at_once=20)
        await world.run(12, shift=60.0)
        world.by_name["a"].alive = False
        world.link("r1", "b")
        await world.run(200, shift=60.0, at_once=10)  # longer than the manager waits for what is told again
        (alert,) = [alert for alert in await world.alerts() if alert.cause == "heat"]
        assert (alert.state, alert.times, alert.clear_ns) == ("open", 1, 0)
        assert alert.gateway == world.by_name["b"].store.gateway_id
        assert world.opened()["r1", "heat"] == 1


async def test_what_began_and_was_stored_before_the_kill_but_judged_by_nobody_is_found_by_the_next_one(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    async with open_replicas(tmp_path, postgres.schema(), "a", "b") as world:
        world.link("r1", "a")
        await world.run(120, at_once=20)  # long enough for a state to be saved
        for second in range(world.second, world.second + 12):
            world.submit("r1", "a", second=second, shift=60.0)
        await world.by_name["a"].stored()
        world.second += 12
        world.clock.advance(12.0)
        world.by_name["a"].alive = False
        world.link("r1", "b")
        await world.run(3)
        assert ("r1", "heat") in world.opened()
        (alert,) = [alert for alert in await world.alerts() if alert.cause == "heat"]
        assert alert.first_ns < (world.now_s - 10.0) * 1e9
        assert len([edge for edge in world.by_name["b"].edges if edge.finding.kind == "motor_hot"]) >= 1


async def test_a_gateway_that_hung_and_comes_back_judges_and_saves_nothing_of_what_another_has(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    async with open_replicas(tmp_path, postgres.schema(), "a", "b") as world:
        world.link("r1", "a")
        await world.run(60, at_once=20)
        a, b = world.by_name["a"], world.by_name["b"]
        late = await a.ownership._dump(dict(a.ownership.held), 1e9)
        a.alive = False  # it hangs
        world.link("r1", "b")
        await world.run(15)
        assert world.judges("r1") == ["b"]
        stored = await b.store.read(lambda engine: state_of(engine, "r1"))
        a.alive = True
        assert await a.ownership._store(late) == set()
        rows = a.watch.describe()["rows"]
        world.submit("r1", "a", second=world.second)
        await a.stored()
        await a.watch.run_cycle()
        assert a.watch.describe()["rows"] == rows
        assert not a.ownership.sure
        await a.step()
        assert world.judges("r1") == ["b"]
        assert await b.store.read(lambda engine: state_of(engine, "r1")) == stored


async def test_a_robot_whose_gateway_died_and_that_comes_nowhere_is_offline_once_until_it_comes_anywhere(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    async with open_replicas(tmp_path, postgres.schema(), "a", "b", "c") as world:
        world.link("r1", "a")
        await world.run(60, at_once=10)  # long enough for a state to be saved
        world.by_name["a"].alive = False
        world.home["r1"] = ""
        await world.run(25, at_once=5)
        assert world.judges("r1") == []  # it has its time to come
        await world.run(20, at_once=2)
        (evaluator,) = world.judges("r1")
        assert world.opened() == {("r1", "offline"): 1}
        other = "c" if evaluator == "b" else "b"
        world.link("r1", other)
        await world.run(45, at_once=3)
        assert world.judges("r1") == [other]
        assert {alert.cause: alert.state for alert in await world.alerts()} == {"offline": "resolved"}
        assert world.opened() == {("r1", "offline"): 1}


async def test_a_robot_that_is_away_from_all_stays_with_its_gateway_and_that_one_says_so(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    async with open_replicas(tmp_path, postgres.schema(), "a", "b") as world:
        world.link("r1", "a")
        await world.run(20, at_once=10)
        world.link("r1", "")
        await world.run(60, at_once=5)
        assert world.judges("r1") == ["a"]
        assert world.opened() == {("r1", "offline"): 1}


async def test_a_gateway_that_ends_in_good_order_leaves_all_it_learned(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    url = postgres.schema()
    async with open_replicas(tmp_path / "first", url, "a") as world:
        world.link("r1", "a")
        await world.run(90, at_once=20)
        before = world.judged("a")
    async with open_replicas(tmp_path / "second", url, "b") as world:
        world.second = 90
        world.clock.advance(95.0)
        world.link("r1", "b")
        await world.run(1, robots=())
        assert world.judges("r1") == ["b"]
        assert world.judged("b") == before


async def test_a_gateway_that_is_started_again_at_once_goes_on(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    async with open_replicas(tmp_path, url, "a") as world:
        world.link("r1", "a")
        await world.run(80, at_once=20)
        before = world.judged("a")
        world.by_name["a"].alive = False
    async with open_replicas(tmp_path, url, "a") as world:
        world.second = 80
        world.clock.advance(81.0)
        world.link("r1", "a")
        await world.run(1, robots=())
        assert world.judged("a") == before


async def test_what_cannot_be_read_is_learned_anew_and_said_once(
    tmp_path: Path, postgres: PostgresServer, caplog: pytest.LogCaptureFixture
) -> None:
    url = postgres.schema()
    async with open_replicas(tmp_path / "first", url, "a") as world:
        world.link("r1", "a")
        await world.run(60, at_once=20)
    async with open_replicas(tmp_path / "second", url, "b") as world:
        spoil = "UPDATE watch_states SET state = ?"
        await world.by_name["b"].store.run(lambda engine: engine.execute(spoil, b"nonsense"))
        world.second = world.sent["r1"] = 60
        world.clock.advance(60.0)
        world.link("r1", "b")
        with caplog.at_level(logging.WARNING):
            await world.run(20)
        (said,) = [record.message for record in caplog.records if record.name.startswith("gateway.alerting.watch")]
        assert "learned anew" in said
        assert 15 <= world.judged("b")["imu.x"][3] <= 20


async def test_a_gateway_that_lives_and_does_not_let_go_loses_the_robot_after_a_while(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    async with open_replicas(tmp_path, postgres.schema(), "a", "b") as world:
        world.link("r1", "a")
        await world.run(10)
        stuck = await world.by_name["b"].store.run(
            lambda engine: take_states(engine, ["r1"], "stuck", now_ns=world.clock.wall_ns(), force=True)
        )
        assert stuck == {"r1": 2}
        alive = "INSERT INTO gateways VALUES ('stuck', ?)"
        await world.by_name["b"].store.run(lambda engine: engine.execute(alive, 1 << 62))
        await world.run(5)
        assert world.judges("r1") == []
        await world.run(15)
        assert world.judges("r1") == ["a"]


def state_of(engine: StoreEngine, robot: str) -> Saved | None:
    with engine.transaction(write=False):
        return read_state(engine, robot)


async def test_questions_and_lessons_go_to_the_gateway_that_judges_the_robot(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    async with open_replicas(tmp_path, postgres.schema(), "a", "b") as world:
        meshes = FakeMeshes()
        a, b = world.by_name["a"], world.by_name["b"]
        for one in (a, b):
            mesh = meshes.join(one.store.gateway_id)
            for verb, answer in answers(one.watch).items():
                mesh.on_request(verb, answer)
            one.watch.remote = RemoteWatch(one.store, partial(mesh.request, timeout_s=5.0))
        world.link("r1", "a")
        await world.run(LEARN_S, at_once=20)
        assert await b.watch.band("r1", "imu.x", 0, 1 << 62) == []  # a keeps points from now on
        await world.run(12, shift=60.0)
        assert await b.watch.learning("r1") == await a.watch.learning("r1") != []
        assert await b.watch.band("r1", "imu.x", 0, 1 << 62) == await a.watch.band("r1", "imu.x", 0, 1 << 62) != []
        found = next(alert for alert in await world.alerts() if alert.cause == "change")
        teaching = asyncio.create_task(b.watch.normal(found))
        while not teaching.done():
            await world.run(1, shift=60.0)
        assert any("counts as normal" in sentence for sentence in teaching.result())
        a.alive = False
        meshes.leave(a.store.gateway_id)
        assert await b.watch.learning("r1") == []
        with pytest.raises(PeerGoneError):
            await b.watch.normal(found)


async def test_a_store_that_is_away_is_said_once_and_asked_again(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "STEP_S", 0.0)
    ends = ["away", "away", "full", "", "full"]

    class Away:
        gateway_id = "a"

        async def run(self, job: Callable[[StoreEngine], Any]) -> Any:
            if not ends:
                await asyncio.Event().wait()
            if end := ends.pop(0):
                raise StoreError(end)
            return {}, []

    database: Any = Away()
    clock, nobody = ManualClock(), cast("Any", SimpleNamespace(local=list))
    ownership = Ownership(database, nobody, nobody, clock=clock, where=nobody, gained=nobody, lost=nobody)
    with caplog.at_level(logging.WARNING):
        running = asyncio.create_task(ownership.run())
        for _ in range(40):
            await asyncio.sleep(0)
            clock.advance(1.0)
        assert not running.done()
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
    said = "which robots are judged here cannot be stored or read now: "
    assert [record.message for record in caplog.records] == [said + end for end in ("away", "full", "full")]
    assert ends == []
