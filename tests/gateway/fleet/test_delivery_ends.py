"""How commands end by time, by their gateway's end, or beside the same order: one row of each, on the world of
test_delivery, whose examples come to these by chance.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from gateway.domain.fleet.command import CANCELLED, DELIVERED, DONE, EXPIRED, FAILED, ISSUED, Command, command_of_wire
from gateway.fleet import command_manager as module
from gateway.fleet.command_manager import NewCommand
from gateway.fleet.delivery import IMMEDIATE_GRACE_S
from metaros._proto import link_pb2
from metaros.limits import LIMITS
from tests.gateway.fleet.test_delivery import ANN, ROBOT, World


@pytest.fixture
async def world(tmp_path: Path) -> AsyncIterator[World]:
    world = World(tmp_path, 0)
    yield world
    for manager in world.managers:
        await manager.delivery.close()
    world.life.end()
    world.base.engine.close()


def order(node: str = "n", *, durable: bool = True, expires_s: float = 60.0, key: str | None = None) -> NewCommand:
    """A log to be read."""
    return NewCommand(
        robot=ROBOT, kind="read_log", request={"node": node}, durable=durable, expires_s=expires_s, idempotency=key
    )


async def turns(count: int = 40) -> None:
    """What was spawned goes on."""
    for _ in range(count):
        await asyncio.sleep(0)


def end(command: Command) -> tuple[str, str, str]:
    """How it went."""
    return command.state, command.code, command.message


async def test_a_look_ends_what_never_left_what_is_silent_and_what_its_gateway_left_behind(world: World) -> None:
    manager = world.managers[0]
    world.connect(0)
    silent = await manager.send(order("silent", expires_s=5.0), ANN)
    await turns()
    world.cut()
    late = await manager.send(order("late", expires_s=5.0), ANN)
    orphan = await manager._rows.add(manager._made(order("orphan", durable=False), ANN), most_open=9)
    waits = await manager.send(order("waits", expires_s=100_000.0), ANN)
    assert (await manager.get(silent.id)).state == DELIVERED
    world.clock.advance(5.0)
    await manager.delivery.look()
    assert end(await manager.get(late.id)) == (EXPIRED, "expired", "its robot did not come")
    assert [(await manager.get(one.id)).state for one in (silent, orphan)] == [DELIVERED, ISSUED]
    world.clock.advance(max(LIMITS.command_silence_s, orphan.timeout_ms / 1000 + IMMEDIATE_GRACE_S))
    await manager.delivery.look()
    unknown = "its robot did not say in time how it went: whether it was carried out is not known"
    assert end(await manager.get(silent.id)) == (EXPIRED, "expired", unknown)
    left = "its gateway ended while it ran: nobody knows"
    assert end(ended := await manager.get(orphan.id)) == (FAILED, "timeout", left)
    assert ended.ended_ns == world.clock.wall_ns()
    assert (await manager.get(waits.id)).state == ISSUED


async def test_what_is_past_its_time_is_not_sent_and_what_is_behind_it_is(world: World) -> None:
    manager = world.managers[0]
    late, fresh = [await manager.send(order(str(expires_s), expires_s=expires_s), ANN) for expires_s in (5.0, 60.0)]
    world.clock.advance(5.0)
    world.connect(0)
    await turns()
    assert end(await manager.get(late.id)) == (EXPIRED, "expired", "its robot did not come")
    assert (await manager.get(fresh.id)).state == DELIVERED
    assert world.link is not None
    assert [frame.command.read_log.node for frame in world.link.down if frame.HasField("command")] == ["60.0"]


async def test_a_gateway_that_ends_sends_nothing_more(world: World) -> None:
    manager = world.managers[0]
    waits = await manager.send(order(), ANN)
    world.connect(0)
    await asyncio.sleep(0)  # its delivery is at the store
    await manager.delivery.close()
    await turns()
    assert world.link is not None
    assert (list(world.link.down), (await manager.get(waits.id)).state) == ([], ISSUED)


async def test_who_waits_too_short_has_it_as_it_is_and_who_waits_long_its_end(world: World) -> None:
    manager = world.managers[0]
    made = await manager.send(order(), ANN)
    assert await manager.wait(made.id, 0.0) == await manager.get(made.id)
    waiting = asyncio.create_task(manager.wait(made.id, 60.0))
    await turns()
    await manager.cancel(made.id)
    assert (await waiting).state == CANCELLED


@pytest.mark.parametrize("durable", [True, False])
async def test_the_same_order_twice_at_once_is_one_command(world: World, durable: bool) -> None:
    manager = world.managers[0]
    world.connect(0)
    sending = asyncio.gather(*(manager.send(order(durable=durable, key="mine"), ANN) for _ in range(2)))
    await turns()
    assert world.link is not None
    (asked,) = [frame.command for frame in world.link.down if frame.HasField("command")]
    if not durable:
        manager._commands.on_result(ROBOT, link_pb2.CommandResult(command_id=asked.command_id, ok=True, payload=b"{}"))
    one, two = await sending
    assert one.id == two.id == command_of_wire(asked.command_id)
    assert [command.id for command in await manager.list(limit=9)] == [one.id]


async def test_while_the_store_is_away_the_history_waits(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "NOTE_S", 0.0)
    monkeypatch.setattr(module, "NOTE_RETRY_S", 0.0)
    manager = world.managers[0]
    writing = asyncio.create_task(manager._write_notes())
    world.base.fail = 2
    with manager.track(order(durable=False), ANN) as noted:
        noted.result = {"lines": []}
    await turns()
    writing.cancel()
    await asyncio.gather(writing, return_exceptions=True)
    assert world.base.fail == 0
    assert [(command.state, command.result) for command in await manager.list(limit=9)] == [(DONE, '{"lines":[]}')]
