"""Delivering once more what happened."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import replace

import pytest

from gateway.domain.delivery import Put
from gateway.domain.event import Event
from gateway.domain.happening import Happening, Replay, Span
from gateway.errors import TooManyError
from gateway.queue.desk import QueueDesk
from gateway.store.engine import StoreEngine
from gateway.store.events import add_events
from gateway.store.happenings import add_happenings
from metaros.limits import LIMITS
from tests.gateway.queue.world import Told, World, one
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
            Happening(id=str(at), type="order", source="shop", at_ns=at * S, data={"n": at}) for at in range(number)
        ]
        add_happenings(engine, orders, gateway="a", now_ns=number * S)

    await world.store().run(job)


def again(happening: Happening) -> Sequence[Put]:
    """To one target."""
    return [one("t", happening.id.encode(), happening=happening.id)]


async def over(desk: QueueDesk, replay_id: str) -> Replay:
    """A replay once it has ended."""
    found: list[Replay] = []

    async def look() -> None:
        while not found:
            found.extend(item for item in await desk.replays() if item.id == replay_id and item.ended_ns)
            await asyncio.sleep(0.01)

    async with asyncio.timeout(60.0):
        await look()
    return found[0]


async def test_what_matches_in_a_span_is_delivered_once_a_replay(any_world: World) -> None:
    world = any_world
    told = Told()
    desk = await world.desk(told, limits=FAST)
    await stored(world, 120)
    asked = Replay(id="one", span=Span(from_ns=10 * S, to_ns=110 * S), spec={"pattern": {}})
    begun = await desk.replay(asked, lambda item: item.type == "order" and item.data["n"] % 2 == 0, again)
    assert (begun.id, begun.ended_ns) == ("one", 0)
    ended = await over(desk, "one")
    assert (ended.read, ended.put, ended.code, ended.spec) == (200, 50, "", {"pattern": {}})
    await world.drive(desk)
    assert sorted(int(item.put.payload) for item in told.begun) == list(range(10, 110, 2))
    assert (await desk.replay(asked, lambda item: True, again)).ended_ns
    assert await world.drive(desk) == 0
    await desk.replay(replace(asked, id="two"), lambda item: item.id == "e-20", again)
    await over(desk, "two")
    assert await world.drive(desk) == 1


async def test_a_replay_that_was_broken_off_goes_on_where_it_was(world: World) -> None:
    told = Told()
    desk = await world.desk(told, limits=replace(LIMITS, replay_per_s=1))
    await stored(world, 120)
    asked = Replay(id="one", span=Span(from_ns=0, to_ns=1 << 60, types=("order",)))
    await desk.replay(asked, lambda item: True, again)
    read = 0
    while not read:
        read = (await desk.replays())[0].read
    await desk.close()
    assert 0 < read < 120
    later = await world.desk(told, limits=FAST)
    (found,) = await later.replays()
    assert not found.ended_ns
    await later.replay(found, lambda item: True, again)
    assert (await over(later, "one")).put == 120
    await world.drive(later)
    assert sorted(int(item.put.payload) for item in told.begun) == list(range(120))


async def test_a_replay_waits_while_the_queue_is_full_and_can_be_stopped(
    world: World, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level("DEBUG", "gateway.queue.replaying")
    told = Told()
    desk = await world.desk(told, limits=replace(FAST, queue_rows=60, replays_at_once=1))
    await stored(world, 100)
    asked = Replay(id="one", span=Span(from_ns=0, to_ns=1 << 60, types=("order",)))
    await desk.replay(asked, lambda item: True, again)
    with pytest.raises(TooManyError):
        await desk.replay(replace(asked, id="two"), lambda item: True, again)
    await wait_until_async(lambda: "replay one waits" in caplog.text)
    assert await desk.stop_replay("one")
    assert not await desk.stop_replay("one")
    ended = await over(desk, "one")
    assert (ended.code, ended.read, ended.put) == ("stopped", 50, 50)
    assert await world.drive(desk) == 50


async def test_a_pattern_that_fails_ends_its_replay(world: World, caplog: pytest.LogCaptureFixture) -> None:
    desk = await world.desk(Told(), limits=FAST)
    await stored(world, 3)

    def wrong(item: Happening) -> bool:
        raise KeyError(item.id)

    await desk.replay(Replay(id="one", span=Span(from_ns=0, to_ns=1 << 60)), wrong, again)
    assert (await over(desk, "one")).code == "replay_failed"
    await wait_until_async(lambda: "replay one failed" in caplog.text)
