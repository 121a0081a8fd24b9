"""Delivering once more what happened."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import replace

import pytest

from gateway.automation.queue.manager import QueueManager
from gateway.domain.automation.delivery import Put
from gateway.domain.automation.event import Event
from gateway.domain.automation.gateway_event import GatewayEvent, Replay, Span
from gateway.errors import TooManyError
from gateway.store.automation.events import add_events
from gateway.store.automation.gateway_events import add_gateway_events
from gateway.store.engine import StoreEngine
from metaros.limits import LIMITS
from tests.gateway.automation.queue.world import Reported, World, one
from tests.support.waiting import wait_until_async

S = 1_000_000_000
FAST = replace(LIMITS, replay_per_s=100_000)


async def stored(world: World, number: int) -> None:
    """So many orders, a second apart, and an event of the journal before each."""

    def job(engine: StoreEngine) -> None:
        add_events(
            engine, [Event(seq=0, kind="robot.online", robot="r", at_ns=at * S, gateway="a") for at in range(number)]
        )
        orders = [
            GatewayEvent(id=str(at), type="order", source="shop", at_ns=at * S, data={"n": at}) for at in range(number)
        ]
        add_gateway_events(engine, orders, gateway="a", now_ns=number * S)

    await world.store().run(job)


def again(gateway_event: GatewayEvent) -> Sequence[Put]:
    """To one target."""
    return [one("t", gateway_event.id.encode(), event_id=gateway_event.id)]


async def over(manager: QueueManager, replay_id: str) -> Replay:
    """A replay once it has ended."""
    found: list[Replay] = []

    async def scan() -> None:
        while not found:
            found.extend(item for item in await manager.replays() if item.id == replay_id and item.ended_ns)
            await asyncio.sleep(0.01)

    async with asyncio.timeout(60.0):
        await scan()
    return found[0]


async def test_what_matches_in_a_span_is_delivered_once_a_replay(any_world: World) -> None:
    world = any_world
    reported = Reported()
    manager = await world.manager(reported, limits=FAST)
    await stored(world, 120)
    asked = Replay(id="one", span=Span(from_ns=10 * S, to_ns=110 * S), spec={"pattern": {}})
    begun = await manager.replay(asked, lambda item: item.type == "order" and item.data["n"] % 2 == 0, again)
    assert (begun.id, begun.ended_ns) == ("one", 0)
    ended = await over(manager, "one")
    assert (ended.read, ended.put, ended.code, ended.spec) == (200, 50, "", {"pattern": {}})
    await world.drive(manager)
    assert sorted(int(item.put.payload) for item in reported.begun) == list(range(10, 110, 2))
    assert (await manager.replay(asked, lambda item: True, again)).ended_ns
    assert await world.drive(manager) == 0
    await manager.replay(replace(asked, id="two"), lambda item: item.id == "e-20", again)
    await over(manager, "two")
    assert await world.drive(manager) == 1


async def test_a_replay_that_was_broken_off_goes_on_where_it_was(world: World) -> None:
    reported = Reported()
    manager = await world.manager(reported, limits=replace(LIMITS, replay_per_s=1))
    await stored(world, 120)
    asked = Replay(id="one", span=Span(from_ns=0, to_ns=1 << 60, types=("order",)))
    await manager.replay(asked, lambda item: True, again)
    read = 0
    while not read:
        read = (await manager.replays())[0].read
    await manager.close()
    assert 0 < read < 120
    later = await world.manager(reported, limits=FAST)
    (found,) = await later.replays()
    assert not found.ended_ns
    await later.replay(found, lambda item: True, again)
    assert (await over(later, "one")).put == 120
    await world.drive(later)
    assert sorted(int(item.put.payload) for item in reported.begun) == list(range(120))


async def test_a_replay_waits_while_the_queue_is_full_and_can_be_stopped(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("DEBUG", "gateway.automation.queue.replay_runner")
    reported = Reported()
    manager = await world.manager(reported, limits=replace(FAST, queue_rows=60, replays_at_once=1))
    await stored(world, 100)
    asked = Replay(id="one", span=Span(from_ns=0, to_ns=1 << 60, types=("order",)))
    await manager.replay(asked, lambda item: True, again)
    with pytest.raises(TooManyError):
        await manager.replay(replace(asked, id="two"), lambda item: True, again)
    await wait_until_async(lambda: "replay one waits" in caplog.text)
    assert await manager.stop_replay("one")
    assert not await manager.stop_replay("one")
    ended = await over(manager, "one")
    assert (ended.code, ended.read, ended.put) == ("stopped", 50, 50)
    assert await world.drive(manager) == 50


async def test_a_pattern_that_fails_ends_its_replay(world: World, caplog: pytest.LogCaptureFixture) -> None:
    manager = await world.manager(Reported(), limits=FAST)
    await stored(world, 3)

    def wrong(item: GatewayEvent) -> bool:
        raise KeyError(item.id)

    await manager.replay(Replay(id="one", span=Span(from_ns=0, to_ns=1 << 60)), wrong, again)
    assert (await over(manager, "one")).code == "replay_failed"
    await wait_until_async(lambda: "replay one failed" in caplog.text)
