"""What is kept of calls: records in the store, counts by minutes, lines in memory."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from typing import Any

import pytest

from gateway.automation.functions.ledger import Ledger
from gateway.automation.functions.logs import LogBuffer
from gateway.automation.functions.meters import FunctionMeters
from gateway.domain.automation.invocation import ERROR, OK, THROTTLED, InvocationFilter, Recorded
from gateway.domain.fleet.command import new_command_id
from gateway.errors import TooManyError
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.gateway.automation.queue.world import World

EVERY = InvocationFilter()


def call(clock: ManualClock, **changes: Any) -> Recorded:
    """A call that has just ended."""
    usual: dict[str, Any] = {
        "id": new_command_id(clock.wall_ns()),
        "request_id": "r",
        "function": "f",
        "version": "$LATEST",
        "qualifier": "",
        "kind": "request",
        "robot": "",
        "status": OK,
        "error_type": "",
        "error_message": "",
        "began_ns": clock.wall_ns(),
        "duration_ms": 2.0,
        "init_ms": 0.0,
        "max_memory_mb": 14,
        "log": "START\nEND\n",
    }
    return Recorded(**{**usual, **changes})


async def test_pages_of_calls_are_filtered_and_keep_robots_apart(world: World) -> None:
    clock = world.clock
    ledger = Ledger(world.store(), FunctionMeters(clock=clock), clock=clock)
    made = []
    for number in range(5):
        clock.advance(1)
        status = ERROR if number == 3 else OK
        made.append(call(clock, robot=f"r{number % 2}", status=status, error_message="a\0b"))
        ledger.add(made[-1])
    ledger.add(call(clock, function="g"))
    await ledger.close()
    page = await ledger.page(replace(EVERY, function="f"), limit=3)
    assert [item.id for item in page] == [item.id for item in made[:1:-1]]
    rest = await ledger.page(replace(EVERY, function="f"), limit=3, before=page[-1].id)
    assert [item.id for item in rest] == [made[1].id, made[0].id]
    assert [item.id for item in await ledger.page(replace(EVERY, status=ERROR), limit=9)] == [made[3].id]
    seen = await ledger.page(replace(EVERY, function="f", sees=lambda robot: robot == "r1"), limit=9)
    assert {item.robot for item in seen} == {"r1"}
    assert seen[0].error_message == "a\ufffdb"


async def test_a_hot_function_has_its_failures_and_a_share_of_the_rest(world: World) -> None:
    clock = world.clock
    meters = FunctionMeters(clock=clock)
    ledger = Ledger(world.store(), meters, clock=clock)
    for number in range(1000):
        ledger.add(call(clock, status=ERROR if number % 100 == 99 else OK))
    ledger.add(call(clock, function="g"))
    await ledger.close()
    assert meters.stats("f", window_s=60).invocations == 1000
    assert ledger.skipped == 990 - LIMITS.invocations_per_s
    assert len(await ledger.page(replace(EVERY, status=ERROR), limit=999)) == 10
    assert len(await ledger.page(replace(EVERY, function="g"), limit=999)) == 1


async def test_old_calls_go_and_too_many_do(world: World) -> None:
    clock = world.clock
    limits = replace(LIMITS, invocations_kept=3, invocations_kept_s=100.0)
    ledger = Ledger(world.store(), FunctionMeters(clock=clock), clock=clock, limits=limits)
    for _ in range(5):
        clock.advance(1)
        ledger.add(call(clock))
    await ledger.store_some()
    assert await ledger.purge() == 2
    assert await ledger.purge() == 0
    clock.advance(99)
    assert await ledger.purge() == 1
    assert len(await ledger.page(EVERY, limit=9)) == 2


async def test_a_restart_knows_the_last_hours_counts_but_counts_from_zero(world: World) -> None:
    clock = world.clock
    ledger = Ledger(world.store(), FunctionMeters(clock=clock), clock=clock)
    ledger.add(call(clock, init_ms=50.0))
    ledger.add(call(clock, status=THROTTLED))
    await ledger.close()
    meters = FunctionMeters(clock=clock)
    await Ledger(world.store(), meters, clock=clock).start()
    stats = meters.stats("f", window_s=3600)
    assert (stats.invocations, stats.cold_starts, stats.throttles) == (1, 1, 1)
    assert meters.totals == {}


def test_percentiles_are_right_within_a_step() -> None:
    clock = ManualClock()
    meters = FunctionMeters(clock=clock)
    for number in range(1, 1001):
        meters.count(call(clock, duration_ms=number / 10))
    stats = meters.stats("f", window_s=60)
    for found, true in ((stats.p50_ms, 50.0), (stats.p95_ms, 95.0), (stats.p99_ms, 99.0)):
        assert found == pytest.approx(true, rel=0.07)
    assert meters.percentiles(window_s=60)[0.5] == stats.p50_ms
    clock.advance(3600)
    assert meters.stats("f", window_s=60).p50_ms is None
    assert meters.stats("f", window_s=2 * 3600).invocations == 1000


@dataclass(frozen=True)
class Piece:
    """What an engine tells."""

    text: str
    function: str = "f"
    version: str = "1"
    request_id: str = "r"
    at_ns: int = 1


def test_lines_are_bounded_by_function_and_in_all() -> None:
    registry = LogBuffer(limits=replace(LIMITS, function_log_lines=3, function_log_bytes=1500))
    registry.add(Piece("1\n2\n3\n4\n"))
    assert [line.text for line in registry.page("f", limit=9)] == ["2", "3", "4"]
    assert [line.text for line in registry.page("f", limit=1, before=4)] == ["3"]
    registry.add(Piece("x" * 500 + "\n" + "y" * 500, function="g"))
    assert registry.page("f", limit=9) == []
    assert len(registry.page("g", limit=9)) == 2


async def test_who_follows_gets_every_line_until_the_end() -> None:
    registry = LogBuffer(limits=replace(LIMITS, function_log_streams=1))
    registry.add(Piece("before"))
    got: list[str] = []

    async def follow() -> None:
        async for lines in registry.follow("f", after=0):
            got.extend(line.text for line in lines)

    task = asyncio.create_task(follow())
    await asyncio.sleep(0)
    with pytest.raises(TooManyError):
        await anext(registry.follow("f"))
    registry.add(Piece("one\ntwo"))
    registry.add(Piece("not mine", function="g"))
    await asyncio.sleep(0)
    registry.add(Piece("three"))
    await asyncio.sleep(0)
    registry.end()
    await asyncio.wait_for(task, 10)
    assert got == ["before", "one", "two", "three"]
