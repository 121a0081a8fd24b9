"""Deliveries from their acceptance to their end, on both databases and a clock that moves when told."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from dataclasses import replace

import pytest

from gateway.domain.automation.delivery import (
    DEAD,
    DONE,
    Dead,
    DeadFilter,
    Delivery,
    Done,
    Policy,
    Put,
    Result,
    Retry,
    Share,
)
from gateway.domain.errors import QueueFullError
from gateway.errors import UnstorableError
from gateway.store.automation import deliveries
from metaros.errors import TooLargeError
from metaros.limits import LIMITS
from tests.gateway.automation.queue.world import KIND, Reported, World, one
from tests.support.waiting import wait_until_async

LAMBDA = Policy(backoff="lambda")


async def fails(delivery: Delivery) -> Result:
    """As a function that raises."""
    return Retry("Unhandled", "ValueError: no")


async def throttled(delivery: Delivery) -> Result:
    """As a function with too many calls."""
    return Retry("throttled", counts=False)


async def test_everything_accepted_is_delivered_once_and_then_forgotten_but_for_its_dedup(any_world: World) -> None:
    world = any_world
    reported = Reported()
    manager = await world.manager(reported)
    ids = await manager.accept([one("t", b"1", dedup="d", context={"n": 1}), one("u", b"2")])
    assert await world.drive(manager) == 2
    assert {item.id: item.put.payload for item in reported.begun} == {ids[0]: b"1", ids[1]: b"2"}
    assert reported.begun[0].put.context == {"n": 1}
    assert await manager.accept([one("t", dedup="d")]) == ids[:1]
    assert await world.drive(manager) == 0
    status = await manager.status()
    assert (status.totals.live, status.totals.done.rows, status.under_way) == (Share(), 1, 0)
    assert status.counts == {DONE: 2}
    kept = await manager.delivery(ids[0])
    assert kept is not None
    assert (kept.state, kept.put.payload) == (DONE, b"")
    assert await manager.delivery(ids[1]) is None


async def test_a_function_that_fails_is_tried_after_one_and_two_minutes_and_is_then_dead(world: World) -> None:
    reported = Reported(act=fails)
    manager = await world.manager(reported)
    (delivery_id,) = await manager.accept([one(policy=LAMBDA)])
    tries: list[int] = []
    for second in range(0, 400, 10):
        tries += [second] * await world.drive(manager)
        world.clock.advance(10.0)
    assert tries == [0, 60, 180]
    assert reported.ends == [(delivery_id, Dead("Unhandled", "ValueError: no"))]
    (letter,) = await manager.dead_page(DeadFilter(), limit=9)
    assert (letter.id, letter.attempts, letter.tries, letter.code) == (delivery_id, 3, 3, "Unhandled")
    assert (await world.totals()).dead.rows == 1


async def test_what_is_throttled_is_tried_until_it_is_six_hours_old(world: World) -> None:
    reported = Reported(act=throttled)
    manager = await world.manager(reported)
    (delivery_id,) = await manager.accept([one(policy=LAMBDA)])
    pauses: list[float] = []
    last_s = world.clock.monotonic_s()
    begun_s = last_s
    while not reported.ends:
        if await world.drive(manager):
            pauses.append(world.clock.monotonic_s() - last_s)
            last_s = world.clock.monotonic_s()
        world.clock.advance(60.0)
    assert reported.ends == [(delivery_id, Dead("too_old", "it was not delivered in time"))]
    assert 6 * 3600 <= world.clock.monotonic_s() - begun_s <= 6 * 3600 + 120
    assert 72 <= len(pauses) < 400  # at most 5 minutes apart
    assert max(pauses) <= 360.0
    (letter,) = await manager.dead_page(DeadFilter(), limit=9)
    assert (letter.code, letter.attempts) == ("too_old", 0)


async def test_what_nobody_handles_is_given_up_when_it_is_too_old(world: World) -> None:
    manager = await world.manager(Reported())
    await manager.accept([Put(kind="nobody", target="t", payload=b"", policy=Policy(most_age_s=60.0))])
    world.clock.advance(59.0)
    assert await world.drive(manager) == 0
    assert (await world.totals()).live.rows == 1
    world.clock.advance(1.0)
    await world.drive(manager)
    assert [item.code for item in await manager.dead_page(DeadFilter(), limit=9)] == ["too_old"]


async def test_what_follows_from_an_end_is_put_with_it(world: World) -> None:
    async def act(delivery: Delivery) -> Result:
        return Dead("no") if delivery.put.payload == b"bad" else Done(puts=[one("next", delivery.put.payload)])

    def follow(delivery: Delivery, result: Done | Dead) -> Sequence[Put]:
        return [one("letters", delivery.put.payload, dedup=delivery.id)] if isinstance(result, Dead) else ()

    reported = Reported(act=act, follow=follow)
    manager = await world.manager(reported, limits=replace(LIMITS, queue_rows=2))
    await manager.accept([one("a", b"good"), one("a", b"bad")])
    await manager.dispatcher.step()
    await manager.dispatcher.in_flight.empty(timeout_s=30.0)
    reported.act = Reported().act
    reported.follow = lambda delivery, result: ()
    await world.drive(manager)
    assert sorted((item.put.target, item.put.payload) for item in reported.begun[2:]) == [
        ("letters", b"bad"),
        ("next", b"good"),
    ]


async def test_a_handler_that_raises_or_hangs_fails_that_delivery_and_no_other(world: World) -> None:
    stuck = asyncio.Event()

    async def act(delivery: Delivery) -> Result:
        match delivery.put.payload:
            case b"raise":
                raise LookupError("mine")
            case b"hang":
                while not stuck.is_set():
                    try:
                        await stuck.wait()
                    except asyncio.CancelledError:
                        continue  # one that does not let itself be ended
            case b"cancel":
                raise asyncio.CancelledError
        return Done()

    reported = Reported(act=act, longest_s=0.05)
    manager = await world.manager(reported)
    once = Policy(most_attempts=1)
    await manager.accept([one(payload=name, policy=once) for name in (b"raise", b"hang", b"cancel", b"fine")])
    await manager.dispatcher.scan()
    assert await manager.dispatcher.step() == 4
    await wait_until_async(lambda: not len(manager.dispatcher.in_flight))
    letters = sorted((item.code, item.message) for item in await manager.dead_page(DeadFilter(), limit=9))
    assert letters == [
        ("handler_failed", "LookupError: mine"),
        ("handler_failed", "the handler cancelled itself"),
        ("timeout", "the handler took too long"),
    ]
    assert (await world.totals()).dead.rows == 3
    assert manager.dispatcher.counts == {DEAD: 3, DONE: 1}
    stuck.set()


class Wrong(Reported):
    """Raises where nobody expects it."""

    def room(self, target: str | None = None) -> int:
        """Of some."""
        if target == "room":
            raise KeyError(target)
        return 9

    def timeout_s(self, target: str) -> float:
        """Of some."""
        return {"fine": 9.0}[target]


async def test_a_handler_that_is_wrong_about_itself_stops_nobody_else(world: World) -> None:
    reported = Reported()
    manager = await world.manager(reported)
    manager.handle("wrong", Wrong())
    once = Policy(most_attempts=1)
    await manager.accept([Put(kind="wrong", target="time", payload=b"", policy=once), one()])
    await world.drive(manager)
    assert [item.code for item in await manager.dead_page(DeadFilter(), limit=9)] == ["handler_failed"]
    await manager.accept([Put(kind="wrong", target="room", payload=b""), one()])
    await world.drive(manager)
    assert len(reported.begun) == 2
    assert (await world.totals()).live.rows == 1


async def test_what_ends_its_gateway_each_time_is_dead_in_the_end(world: World) -> None:
    never = asyncio.Event()

    async def act(delivery: Delivery) -> Result:
        await never.wait()
        return Done()

    limits = replace(LIMITS, delivery_losses=3)
    reported = Reported(act=act)
    for life in range(3):
        manager = await world.manager(reported, limits=limits, seed=life)
        if not life:
            await manager.accept([one()])
        await manager.dispatcher.scan()
        assert await manager.dispatcher.step() == 1
        await wait_until_async(lambda life=life: len(reported.begun) == life + 1)
        await world.crash(manager)
    manager = await world.manager(reported, limits=limits)
    await manager.dispatcher.scan()
    await manager.dispatcher.step()
    await manager.dispatcher.in_flight.empty(timeout_s=30.0)
    (letter,) = await manager.dead_page(DeadFilter(), limit=9)
    assert (letter.code, letter.tries, len(reported.begun)) == ("lost", 4, 3)


async def test_a_silent_gateways_leases_are_taken_when_they_end_and_its_late_results_are_nothing(
    shared_world: World,
) -> None:
    world = shared_world
    go = asyncio.Event()

    async def slow(delivery: Delivery) -> Result:
        await go.wait()
        return Done(puts=[one("follow")])

    late, quick = Reported(act=slow), Reported()
    first = await world.manager(late, name="a")
    second = await world.manager(quick, name="b")
    await first.accept([one()])
    await first.dispatcher.step()
    world.clock.advance(20.0)
    await first.dispatcher.extend()
    world.clock.advance(20.0)
    assert await world.drive(second) == 0  # extended: it is the first one's still
    world.clock.advance(11.0)
    assert await world.drive(second) == 1
    assert quick.begun[0].losses == 1
    go.set()
    await first.dispatcher.in_flight.empty(timeout_s=30.0)
    assert first.dispatcher.counts == {}
    assert await world.drive(second) == 0
    assert (await world.totals()).live == Share()


async def test_two_gateways_share_the_work_and_deliver_each_once(shared_world: World) -> None:
    world = shared_world
    reports = [Reported(at_once=7), Reported(at_once=7)]
    managers = [await world.manager(reported, name=name) for reported, name in zip(reports, "ab", strict=True)]
    runs = [asyncio.create_task(manager.run()) for manager in managers]
    ids: list[str] = []
    for start in range(0, 300, 20):
        ids += await managers[start % 40 // 20].accept([one(str(number % 5)) for number in range(start, start + 20)])
    await wait_until_async(lambda: sum(len(reported.begun) for reported in reports) >= 300)
    for run in runs:
        run.cancel()
    await asyncio.gather(*runs, return_exceptions=True)
    for manager in managers:
        await manager.close()
    assert sorted(item.id for reported in reports for item in reported.begun) == sorted(ids)
    assert all(reported.begun for reported in reports)
    assert (await world.totals()).live == Share()


async def test_a_target_with_a_long_backlog_does_not_hold_up_the_others(world: World) -> None:
    reported = Reported(at_once=8)
    manager = await world.manager(reported)
    await manager.accept([one("big") for _ in range(400)])
    await manager.accept([one(f"small{number}") for number in range(20)])
    await world.drive(manager)
    served = [place for place, item in enumerate(reported.begun) if item.put.target != "big"]
    assert len(reported.begun) == 420
    assert served[-1] < 100
    assert reported.most_under_way <= 8


async def test_no_more_of_a_target_are_under_way_than_it_has_room_for(world: World) -> None:
    gate = asyncio.Event()

    async def act(delivery: Delivery) -> Result:
        await gate.wait()
        return Done()

    reported = Reported(act=act, of_target=2)
    manager = await world.manager(reported)
    await manager.accept([*(one("a") for _ in range(9)), *(one("b") for _ in range(9))])
    for _ in range(3):
        await manager.dispatcher.step()
    await wait_until_async(lambda: len(reported.under_way) == 4)
    assert sorted(reported.under_way) == ["a", "a", "b", "b"]
    gate.set()
    await manager.dispatcher.in_flight.empty(timeout_s=30.0)
    await world.drive(manager)
    assert len(reported.begun) == 18


class Batches(Reported):
    """Takes seven at a time, and says of odd payloads that they failed."""

    def batch(self, target: str) -> int:
        """Of one call."""
        return 7

    async def deliver_many(self, some: Sequence[Delivery]) -> Sequence[Result]:
        """All of one target."""
        assert len({item.put.target for item in some}) == 1
        self.begun.extend(some)
        self.sizes.append(len(some))
        if self.short:
            self.short = False
            return []
        return [Retry("odd") if int(item.put.payload) % 2 else Done() for item in some]

    sizes: list[int]
    short = False


async def test_batches_are_of_one_target_with_a_result_for_each(world: World) -> None:
    reported = Batches()
    reported.sizes = []
    manager = await world.manager(reported)
    await manager.accept([one("t" if number < 16 else "u", b"%d" % number) for number in range(20)])
    assert await world.drive(manager) == 20
    assert sorted(reported.sizes) == [2, 4, 7, 7]
    assert manager.dispatcher.counts == {DONE: 10, "waiting": 10}
    reported.short = True
    world.clock.advance(10.0)
    await manager.dispatcher.scan()
    await manager.dispatcher.step()
    await manager.dispatcher.in_flight.empty(timeout_s=30.0)
    assert manager.dispatcher.counts[DONE] == 10  # fewer answers than deliveries: all of that batch failed


async def test_a_full_queue_refuses_and_what_waits_is_delivered(world: World) -> None:
    reported = Reported()
    manager = await world.manager(reported, limits=replace(LIMITS, queue_rows=5))
    answers = await asyncio.gather(
        *(manager.accept([one(), one()]) for _ in range(4)),
        manager.accept([one(payload=bytes(LIMITS.delivery_bytes))]),
        return_exceptions=True,
    )
    assert sorted(type(answer).__name__ for answer in answers) == [
        "QueueFullError", "QueueFullError", "TooLargeError", "list", "list",
    ]  # fmt: skip
    assert await world.drive(manager) == 4
    assert len(await manager.accept([one()])) == 1
    with pytest.raises(QueueFullError, match="queue_rows"):
        await manager.accept([one() for _ in range(5)])
    with pytest.raises(TooLargeError, match="delivery_bytes"):
        await manager.accept([one(payload=bytes(LIMITS.delivery_bytes))])


async def test_what_no_database_takes_is_its_callers_trouble_only(shared_world: World) -> None:
    world = shared_world
    manager = await world.manager(Reported())
    answers = await asyncio.gather(manager.accept([one()]), manager.accept([one("a\0b")]), return_exceptions=True)
    assert [type(answer) for answer in answers] == [list, UnstorableError]
    assert await world.drive(manager) == 1


async def test_redriven_letters_are_delivered_and_new_ones_wait_for_the_next_time(
    any_world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.automation.queue.manager.PAGE", 50)
    world = any_world

    async def act(delivery: Delivery) -> Result:
        return Dead("bad") if delivery.put.target == "bad" else Done()

    reported = Reported(act=act)
    manager = await world.manager(reported)
    ids = await manager.accept([one("bad", str(number).encode()) for number in range(120)])
    await world.drive(manager)
    assert (await world.totals()).dead.rows == 120
    assert await manager.redrive(DeadFilter(ids=tuple(ids[:3]))) == 3
    assert await manager.redrive(DeadFilter(target="none")) == 0
    assert await manager.redrive(DeadFilter(), most=70) == 70
    assert await manager.drop_dead(DeadFilter(), most=9) == 9
    reported.act = Reported().act
    reported.begun.clear()
    await world.drive(manager)
    assert len(reported.begun) == 73
    assert {item.redrives for item in reported.begun} == {1}
    assert (await world.totals()).dead.rows == 120 - 73 - 9
    assert await manager.redrive(DeadFilter()) == 38
    await world.drive(manager)
    assert await world.counted() == {}


async def test_what_others_put_is_found_and_what_is_put_here_is_delivered_at_once(
    world: World, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("gateway.automation.queue.dispatcher.POLL_S", 0.05)
    reported = Reported()
    manager = await world.manager(reported)
    run = asyncio.create_task(manager.run())

    def job(engine: object) -> None:
        deliveries.put(engine, [one("noted")], gateway="x", now_ns=world.clock.wall_ns())  # type: ignore[arg-type]
        manager.notify([one("noted")])

    await world.store().run(job)
    await wait_until_async(lambda: len(reported.begun) == 1)

    def silently(engine: object) -> None:
        deliveries.put(engine, [one("silent")], gateway="x", now_ns=world.clock.wall_ns())  # type: ignore[arg-type]

    await world.store().run(silently)
    await wait_until_async(lambda: len(reported.begun) == 2)
    run.cancel()
    await asyncio.gather(run, return_exceptions=True)


async def test_closing_waits_for_what_is_under_way_and_gives_the_rest_back_unharmed(world: World) -> None:
    gate, never = asyncio.Event(), asyncio.Event()

    async def act(delivery: Delivery) -> Result:
        await (gate if delivery.put.payload == b"quick" else never).wait()
        return Done()

    reported = Reported(act=act)
    manager = await world.manager(reported)
    await manager.accept([one(payload=b"quick"), one(payload=b"slow")])
    await manager.dispatcher.step()
    closing = asyncio.create_task(manager.close(timeout_s=0.2))
    gate.set()
    await closing
    again = Reported()
    later = await world.manager(again, seed=2)
    assert await world.drive(later) == 1
    assert [(item.put.payload, item.losses, item.tries) for item in again.begun] == [(b"slow", 0, 2)]
    assert again.begun[0].put.kind == KIND
