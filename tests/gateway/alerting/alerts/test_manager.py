"""The desk on real stores: what is told is stored, what people do, restarts, and several gateways on one store."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest

from gateway.alerting.alerts.config import AlertConfig
from gateway.alerting.alerts.errors import AlertStateError, UnknownAlertError, UnknownSilenceError
from gateway.automation.events.kinds import event_kind
from gateway.domain.alert import AlertFilter
from gateway.errors import InvalidRequestError, StoreError, TooManyError
from gateway.store.engine import StoreEngine
from metaros.clock import ManualClock
from tests.gateway.alerting.alerts.findings import NOW, S, cleared, edge, opened
from tests.gateway.alerting.alerts.world import World, open_world
from tests.support.servers.databases import on_both
from tests.support.waiting import wait_until_async

NOBODY = "0" * 26


async def test_an_alert_from_its_first_finding_to_its_end(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.report(opened())
        alert = world.alert()
        assert await world.manager.get(alert.id) == alert
        taken = await world.manager.acknowledge(alert.id, by="eve", text="on my way")
        assert (taken.state, taken.acknowledged_by, taken.acknowledged_ns) == ("acknowledged", "eve", NOW)
        await world.manager.assign(alert.id, assignee="bob", by="eve")
        await world.report(cleared())
        await world.step(30)
        over = await world.manager.get(alert.id)
        assert (over.state, over.assignee, over.resolved_by, over.revision) == ("resolved", "bob", "", 4)
        assert world.news == ["opened", "acknowledged", "changed", "resolved"]
        kinds = [kind for kind, _, _ in world.events]
        assert kinds == ["alert.opened", "alert.acknowledged", "alert.changed", "alert.resolved"]
        said = [(item.number, item.by, item.kind, item.text) for item in await world.manager.remarks(alert.id)]
        assert said == [(1, "eve", "acknowledged", "on my way"), (2, "eve", "assigned", "bob")]


async def test_events_are_rows_of_the_table(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world:
        await world.report(opened())
        await world.report(edge("changed", severity="error"))
        await world.manager.resolve(world.alert().id, by="eve")
        for kind, robot, data in world.events:
            assert (robot, tuple(data)) == ("r1", event_kind(kind).data)
        assert [data["what"] for _, _, data in world.events] == ["opened", "escalated", "resolved"]
        assert [data["by"] for _, _, data in world.events] == ["", "", "eve"]


async def test_nobody_is_reported_what_is_not_stored(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world:
        real = world.store.run

        async def away(job: Callable[[StoreEngine], Any]) -> Any:
            raise StoreError("the disk is full")

        world.store.run = away  # type: ignore[method-assign]
        with pytest.raises(StoreError):
            await world.report(opened())
        world.manager.report([edge("changed", severity="error")])
        assert world.told == []
        assert world.alert().severity == "error"
        world.store.run = real  # type: ignore[method-assign]
        await world.manager.save()
        assert [(what, alert.severity) for what, alert in world.told] == [("opened", "error")]


@on_both
async def test_what_no_database_takes_does_not_hold_up_the_rest(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.report(opened(), opened("r2", series="\ud800"), opened("r3"))
        assert {alert.robot for alert in await world.manager.list(AlertFilter(), limit=9)} == {"r1", "r3"}
        assert world.manager.of("r2") == ()


async def test_a_listener_that_fails_spoils_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with open_world(tmp_path) as world:

        def fail(what: str, alert: object) -> None:
            raise RuntimeError("no")

        world.manager.listen(fail)
        await world.report(opened())
        assert world.news == ["opened"]
        assert "who listens to alerts failed at opened" in caplog.text


async def test_what_people_may_do_when_it_is_over(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url) as world:
        await world.report(opened())
        manager, key = world.manager, world.alert().id
        assert (await manager.resolve(key, by="eve", text="done")).resolved_by == "eve"
        refused: list[Callable[[], Awaitable[object]]] = [
            lambda: manager.acknowledge(key, by="bob"),
            lambda: manager.unacknowledge(key, by="bob"),
            lambda: manager.resolve(key, by="bob"),
            lambda: manager.assign(key, assignee="x", by="bob"),
        ]
        for attempt in refused:
            with pytest.raises(AlertStateError):
                await attempt()
        await manager.comment(key, text="it was the fan", by="bob")
        await manager.normal(key, by="bob")
        assert (await manager.attach_clip(key, "CLIP")).clip == "CLIP"
        assert [item.kind for item in await manager.remarks(key)] == ["resolved", "comment", "normal", "clip"]
        assert manager.of("r1") == ()


async def test_the_same_again_changes_nothing(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world:
        await world.report(opened())
        manager, key = world.manager, world.alert().id
        first = await manager.acknowledge(key, by="eve")
        assert await manager.acknowledge(key, by="bob") == first
        back = await manager.unacknowledge(key, by="bob")
        assert (back.state, back.acknowledged_by) == ("open", "")
        assert await manager.unacknowledge(key, by="bob") == back
        assert len(await manager.remarks(key)) == 2


async def test_there_is_no_such_alert(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world:
        for key in (NOBODY, "", "x" * 5000, "../etc"):
            with pytest.raises(UnknownAlertError):
                await world.manager.get(key)
            with pytest.raises(UnknownAlertError):
                await world.manager.acknowledge(key, by="eve")
            with pytest.raises(UnknownSilenceError):
                await world.manager.get_silence(key)


async def test_words_and_remarks_are_bounded(tmp_path: Path) -> None:
    async with open_world(tmp_path, alert_remarks=2, alert_text_chars=10) as world:
        await world.report(opened())
        key = world.alert().id
        for text in ("x" * 11, "a\0b", "\ud800"):
            with pytest.raises(InvalidRequestError):
                await world.manager.comment(key, text=text, by="eve")
        await world.manager.comment(key, text="x" * 10, by="eve")
        await world.manager.comment(key, text="", by="eve")
        with pytest.raises(TooManyError):
            await world.manager.acknowledge(key, by="eve")
        assert (await world.manager.get(key)).state == "open"


@on_both
async def test_silences(tmp_path: Path, store_url: str) -> None:
    async with open_world(tmp_path, url=store_url, silences=1) as world:
        manager = world.manager
        await world.report(opened())
        made = await manager.add_silence(robots=["r1"], up_to="warning", until_ns=NOW + 60 * S, reason="test", by="eve")
        assert world.alert().silence == made.id
        assert manager.robot_counts("r1") == {"open": 0, "error": 0, "warning": 0}
        assert await manager.silences() == await manager.silences(sees=lambda robot: robot == "r1") == [made]
        assert await manager.silences(sees=lambda robot: False) == []
        with pytest.raises(TooManyError):
            await manager.add_silence(until_ns=NOW + 60 * S, by="eve")
        assert (await manager.end_silence(made.id, by="bob")).until_ns == NOW
        assert (world.alert().silence, await manager.silences()) == ("", [])
        assert manager.robot_counts("r1") == {"open": 1, "error": 0, "warning": 1}
        await world.manager.save()
        assert [(what, alert.quiet) for what, alert in world.told][-1] == ("changed", False)


NO_SILENCES: tuple[dict[str, Any], ...] = (
    {"until_ns": NOW},
    {"until_ns": NOW - S},
    {"until_ns": NOW + 367 * 86_400 * S},
    {"until_ns": NOW + 60 * S, "from_ns": NOW + 60 * S},
    {"until_ns": NOW + S, "up_to": "fatal"},
    {"until_ns": NOW + S, "robots": ["x"] * 33},
    {"until_ns": NOW + S, "robots": [""]},
    {"until_ns": NOW + S, "causes": ["x" * 129]},
    {"until_ns": NOW + S, "causes": ["a\0"]},
    {"until_ns": NOW + S, "reason": "x" * 2001},
)


async def test_what_is_no_silence(tmp_path: Path) -> None:
    taken = []
    async with open_world(tmp_path) as world:
        for fields in NO_SILENCES:
            with contextlib.suppress(InvalidRequestError):
                taken.append((fields, await world.manager.add_silence(by="eve", **fields)))
    assert taken == []


async def test_counts_are_of_what_somebody_may_see(tmp_path: Path) -> None:
    async with open_world(tmp_path) as world:
        await world.report(
            opened(severity="error"),
            opened(cause="battery"),
            opened("r2", cause="offline", series=""),
            opened("r2", cause="silence", series="/scan"),
        )
        await world.manager.acknowledge(world.manager.of("r1")[0].id, by="eve")
        assert world.manager.counts() == {
            "open": 3,
            "acknowledged": 1,
            "quiet": 1,
            "severities": {"info": 0, "warning": 2, "error": 1},
        }
        assert world.manager.counts(lambda robot: robot == "r2")["open"] == 2
        assert world.manager.robot_counts("r1") == {"open": 2, "error": 1, "warning": 1}
        assert [alert.severity for alert in world.manager.of("r1")] == ["error", "warning"]


@on_both
async def test_a_restart_knows_what_was_and_ends_what_is_not_reported_again(tmp_path: Path, store_url: str) -> None:
    clock = ManualClock(wall_ns=NOW)
    async with open_world(tmp_path, url=store_url, clock=clock) as world:
        world.manager.report([opened(), opened(cause="battery"), opened(cause="rate", series="/scan")])
        quiet = await world.manager.add_silence(causes=["rate"], until_ns=NOW + 900 * S, by="eve")
        heat = next(alert for alert in world.manager.of("r1") if alert.cause == "heat")
    clock.advance(60)
    async with open_world(tmp_path, url=store_url, clock=clock) as world:
        known = {alert.cause: alert for alert in world.manager.of("r1")}
        assert (known["heat"].id, known["rate"].silence) == (heat.id, quiet.id)
        await world.report(opened(), opened(cause="rate", series="/scan"))
        await world.step(121)
        await world.step(31)
        assert {alert.cause: alert.times for alert in world.manager.of("r1")} == {"heat": 1, "rate": 1}
        assert [(what, alert.cause) for what, alert in world.told if what == "resolved"] == [("resolved", "battery")]


async def test_it_runs_by_itself(tmp_path: Path, store_url: str) -> None:
    config = AlertConfig(clear_s=0.0, tick_s=0.01)
    async with open_world(tmp_path, url=store_url, run=True, config=config, alerts_kept=0) as world:
        world.manager.report([opened()])
        await wait_until_async(lambda: world.news == ["opened"])
        world.manager.report([cleared()])
        await wait_until_async(lambda: world.news[-1] == "resolved")
        assert await world.manager.purge() == 1
        assert await world.manager.list(AlertFilter(), limit=1) == []


async def test_a_store_that_is_away_for_a_while_loses_nothing(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    async with open_world(tmp_path, run=True, config=AlertConfig(tick_s=0.01)) as world:
        real, tries = world.store.run, 0

        async def away(job: Callable[[StoreEngine], Any]) -> Any:
            nonlocal tries
            tries += 1
            if tries < 5:
                raise StoreError("away")
            return await real(job)

        world.store.run = away  # type: ignore[method-assign]
        world.manager.report([opened()])
        await wait_until_async(lambda: world.news == ["opened"])
        assert caplog.text.count("alerts wait for the store: away") == 1


async def test_a_fleet_in_trouble_is_stored_in_bounded_pieces(tmp_path: Path) -> None:
    async with open_world(tmp_path, alerts_unresolved=300) as world:
        world.manager.report([opened(f"r{number}") for number in range(360)])
        await world.step(1)
        assert world.news.count("opened") == 301
        found = await world.manager.list(AlertFilter(causes=("too_many",)), limit=9)
        assert [alert.value for alert in found] == [60.0]
        world.manager.report([cleared(f"r{number}") for number in range(360)])
        for _ in range(4):
            await world.step(31)
        assert world.manager.counts()["open"] == 0


async def pair(tmp_path: Path, url: str, test: Callable[[World, World], Awaitable[None]]) -> None:
    """Two gateways on one store."""
    async with open_world(tmp_path, url=url, name="g1") as one, open_world(tmp_path, url=url, name="g2") as two:
        await test(one, two)


async def test_people_at_another_gateway_do_as_much(tmp_path: Path, shared_url: str) -> None:
    async def test(one: World, two: World) -> None:
        await one.report(opened())
        await two.manager.refresh()
        assert two.alert() == one.alert()
        await two.manager.acknowledge(two.alert().id, by="eve")
        one.manager.report([edge("changed", severity="error")])
        await one.manager.save()  # it does not know yet what eve did
        found = await one.manager.get(one.alert().id)
        assert (found.state, found.severity) == ("acknowledged", "error")
        assert (one.news, two.news) == (["opened", "escalated"], ["acknowledged"])
        await two.manager.refresh()
        await two.manager.resolve(found.id, by="eve")
        await one.manager.refresh()
        assert one.manager.of("r1") == two.manager.of("r1") == ()

    await pair(tmp_path, shared_url, test)


async def test_who_shows_robots_hears_what_changed_anywhere(tmp_path: Path, shared_url: str) -> None:
    async def test(one: World, two: World) -> None:
        received: list[str] = []
        two.manager.on_change(received.append)
        await one.report(opened())
        await two.manager.refresh()
        assert received == ["r1"]
        await two.manager.refresh()
        await two.manager.acknowledge(two.alert().id, by="eve")
        assert received == ["r1", "r1"]
        await one.manager.refresh()
        await one.manager.resolve(one.alert().id, by="eve")
        await two.manager.refresh()
        assert received == ["r1"] * 3

    await pair(tmp_path, shared_url, test)


async def test_a_robot_that_moves_to_another_gateway_keeps_its_alert(tmp_path: Path, shared_url: str) -> None:
    async def test(one: World, two: World) -> None:
        await one.report(opened(), opened(series="b"))
        await two.manager.refresh()
        two.manager.adopt("r1")
        await two.report(opened())
        assert two.alert().id == one.alert().id
        await two.step(120)
        assert [item.finding.series for item in two.alert().findings if item.active] == ["motor.temperature"]
        await two.report(cleared())
        await two.step(30)
        await one.manager.refresh()
        assert one.manager.of("r1") == ()
        assert two.news[-1] == "resolved"

    await pair(tmp_path, shared_url, test)


async def test_two_gateways_that_find_the_same_have_one_alert(tmp_path: Path, shared_url: str) -> None:
    async def test(one: World, two: World) -> None:
        one.manager.report([opened()])
        two.manager.report([opened(series="b")])
        await asyncio.gather(one.manager.save(), two.manager.save())
        await one.manager.refresh()
        await two.manager.refresh()
        assert one.alert().id == two.alert().id
        assert sorted(one.news + two.news) == ["changed", "opened"]
        assert len(await one.manager.list(AlertFilter(), limit=9)) == 1

    await pair(tmp_path, shared_url, test)


async def test_many_who_change_one_alert_at_once_all_do(tmp_path: Path, shared_url: str) -> None:
    async def test(one: World, two: World) -> None:
        await one.report(opened())
        key = one.alert().id
        managers = [one.manager, two.manager] * 5
        await asyncio.gather(*(manager.assign(key, assignee=f"p{n}", by="e") for n, manager in enumerate(managers)))
        assert [item.number for item in await one.manager.remarks(key)] == list(range(1, 11))
        assert (await two.manager.get(key)).revision == 11

    await pair(tmp_path, shared_url, test)


async def test_what_was_deleted_remote_is_forgotten(tmp_path: Path, shared_url: str) -> None:
    async def test(one: World, two: World) -> None:
        await one.report(opened())
        await two.manager.refresh()
        await one.store.run(lambda engine: engine.execute("DELETE FROM alerts"))
        await two.manager.refresh()
        assert two.manager.of("r1") == ()

    await pair(tmp_path, shared_url, test)
