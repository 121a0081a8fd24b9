"""Commands at a gateway that has not the robot's link: they reach it in order, and each has exactly one end."""

from __future__ import annotations

import asyncio

import pytest

from gateway.cluster.relay.wire import RelayedFrame, join, split
from gateway.errors import CommandRefusedError, CommandTimeoutError, ProtocolError, RobotOfflineError
from gateway.fleet import command_dispatcher
from metaros._proto import link_pb2
from metaros.limits import LIMITS
from tests.support.gateways.relay_rig import ROBOT, RelayRig, relay_rig, settle


def uplink(number: int = 1) -> link_pb2.Command:
    return link_pb2.Command(set_uplink=link_pb2.SetUplink(bytes_per_s=number))


async def test_a_command_goes_by_the_home_and_its_result_comes_back() -> None:
    async with relay_rig() as rig:
        result = await rig["b"].commands.run(ROBOT, uplink(7), timeout_s=1)
        assert result.ok
        assert [frame.command.set_uplink.bytes_per_s for frame in rig.frames] == [7]
        assert rig["a"].relays.owed == 0
        assert rig["a"].told == []  # nobody at the home was asked for the result


async def test_a_refusal_keeps_its_code() -> None:
    async with relay_rig() as rig:
        rig.answer = lambda command: link_pb2.CommandResult(command_id=command.command_id, code="scope", message="no")
        with pytest.raises(CommandRefusedError, match="no") as caught:
            await rig["b"].commands.run(ROBOT, uplink(), timeout_s=1)
        assert caught.value.agent_code == "scope"


async def test_commands_of_one_gateway_keep_their_order() -> None:
    async with relay_rig() as rig:
        await asyncio.gather(*(rig["b"].commands.run(ROBOT, uplink(n), timeout_s=1) for n in range(1, 50)))
        assert [frame.command.set_uplink.bytes_per_s for frame in rig.frames] == list(range(1, 50))


async def test_a_result_of_the_largest_frame_comes_back_whole() -> None:
    async with relay_rig() as rig:
        whole = bytes(LIMITS.frame_bytes - 4096)
        rig.answer = lambda command: link_pb2.CommandResult(command_id=command.command_id, ok=True, payload=whole)
        assert (await rig["b"].commands.run(ROBOT, uplink(), timeout_s=1)).payload == whole


async def lost(rig: RelayRig, change: str) -> None:
    rig.answer = lambda command: None
    running = asyncio.create_task(rig["b"].commands.run(ROBOT, uplink(), timeout_s=60))
    await settle()
    assert len(rig.frames) == 1
    if change == "link":
        rig.link("")
    elif change == "moved":
        rig.link("c")
    else:
        rig.kill("a")
    with pytest.raises(RobotOfflineError, match="the outcome is not known"):
        await running


@pytest.mark.parametrize("change", ["link", "moved", "home"])
async def test_who_asked_hears_at_once_that_there_will_be_no_result(change: str) -> None:
    async with relay_rig("abc") as rig:
        await lost(rig, change)
        assert rig["b"].commands.under_way == 0


async def test_a_home_that_has_no_link_any_more_says_so() -> None:
    async with relay_rig() as rig:
        half = rig["b"]
        send = asyncio.create_task(half.commands.run(ROBOT, uplink(), timeout_s=60))
        await asyncio.sleep(0)  # it is on its way
        rig.home = ""
        with pytest.raises(RobotOfflineError, match="no link now"):
            await send
        assert rig.frames == []


async def test_a_home_whose_queue_is_full_is_a_robot_that_cannot_be_reached() -> None:
    async with relay_rig() as rig:
        rig["b"].relays.frames._mesh.full.add("a")  # type: ignore[attr-defined]
        with pytest.raises(RobotOfflineError, match="does not take more"):
            await rig["b"].commands.run(ROBOT, uplink(), timeout_s=1)


async def test_results_that_nobody_remote_waits_for_stay_with_the_home(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(command_dispatcher, "TRAVEL_S", 0.0)
    async with relay_rig("abc") as rig:
        kept: list[link_pb2.Command] = []
        rig.answer = lambda command: kept.append(command)
        running = asyncio.create_task(rig["b"].commands.run(ROBOT, uplink(), timeout_s=0.01))
        await settle()
        assert rig["a"].relays.owed == 1
        reported = link_pb2.CommandResult(command_id=kept[0].command_id, running=True)
        assert not rig["a"].relays.on_result(ROBOT, reported)  # a durable command's word is the delivery's
        rig.kill("b")
        await settle()
        assert rig["a"].relays.owed == 0
        result = link_pb2.CommandResult(command_id=kept[0].command_id, ok=True)
        assert not rig["a"].relays.on_result(ROBOT, result)
        with pytest.raises((CommandTimeoutError, RobotOfflineError)):
            await running


async def test_another_robots_result_does_not_count() -> None:
    async with relay_rig() as rig:
        rig.answer = lambda command: None
        running = asyncio.create_task(rig["b"].commands.run(ROBOT, uplink(), timeout_s=60))
        await settle()
        forged = link_pb2.CommandResult(command_id=rig.frames[0].command.command_id, ok=True)
        assert not rig["a"].relays.on_result("r2", forged)
        assert rig["a"].relays.on_result(ROBOT, forged)
        assert (await running).ok


async def test_what_the_home_remembers_ends_with_the_commands_time() -> None:
    async with relay_rig() as rig:
        rig.answer = lambda command: None
        running = asyncio.create_task(rig["b"].commands.run(ROBOT, uplink(), timeout_s=2))
        await settle()
        assert rig["a"].relays.owed == 1
        rig.clock.advance(8)
        assert rig["a"].relays.owed == 0
        running.cancel()


async def test_others_hear_which_process_of_a_robot_is_linked_and_who_has_it_anew() -> None:
    async with relay_rig("abc") as rig:
        assert [rig[name].begun for name in "abc"] == [[], [(ROBOT, b"process")], [(ROBOT, b"process")]]
        rig["b"].relays.on_remote_session(ROBOT, "c", 7)
        assert rig["b"].fenced == [7]


def test_parcels_and_parts_come_back_as_they_went() -> None:
    relayed = RelayedFrame("r/ü", b"frame", 7)
    assert RelayedFrame.unpack(relayed.pack()) == relayed
    assert list(split(join([b"", b"a", b"bc"]))) == [b"", b"a", b"bc"]
    for broken in (b"\0", b"\0\0\0\5ab"):
        with pytest.raises(ProtocolError):
            list(split(broken))
    with pytest.raises(ProtocolError):
        RelayedFrame.unpack(b"\0")
