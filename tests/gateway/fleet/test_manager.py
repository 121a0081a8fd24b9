"""Commands and drives against a robot that answers, is silent, or goes away."""

from __future__ import annotations

import asyncio
import threading
from dataclasses import dataclass, field
from typing import Any

import pytest

from gateway.domain.channel import Channel
from gateway.domain.fleet.lease import LeaseTable
from gateway.domain.robot import Robot
from gateway.errors import (
    CommandRefusedError,
    InvalidRequestError,
    LeaseRequiredError,
    LeaseTakenError,
    RobotOfflineError,
    TooManyError,
    UnknownRobotError,
)
from gateway.fleet.command_dispatcher import LOOKS_PER_ROBOT, PENDING_PER_ROBOT, CommandDispatcher
from gateway.fleet.manager import MAX_TIMEOUT_S, FleetManager
from gateway.fleet.ros.graph import Endpoint, RobotGraph
from gateway.fleet.ros.typed import is_large
from gateway.fleet.ros.types import TypeRegistry, full_type_name
from gateway.fleet.teleop import TWIST, TWIST_STAMPED, TeleopManager
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import ManualClock
from metaros.errors import TypeHashError
from metaros.idl import type_hash


@dataclass
class Bot:
    """A robot that answers every command at once with `code`; None: not at all."""

    code: str | None = ""
    online: bool = True
    rtt_s: float | None = None
    robot: Robot = field(default_factory=lambda: Robot("r1", "/r1"))
    channels: dict[str, Channel] = field(default_factory=dict)
    frames: list[link_pb2.GatewayFrame] = field(default_factory=list)
    manager: CommandDispatcher | None = None

    @property
    def here(self) -> bool:
        return self.online

    def channel_of(self, topic: str) -> Channel | None:
        return self.channels.get(topic)

    def find(self, robot: str) -> Bot:
        if robot != "r1":
            raise UnknownRobotError(robot)
        return self

    def send(self, robot: str, frame: link_pb2.GatewayFrame) -> None:
        if not self.online:
            raise RobotOfflineError(robot)
        self.frames.append(frame)
        if frame.HasField("command") and self.code is not None and self.manager is not None:
            result = link_pb2.CommandResult(command_id=frame.command.command_id, ok=not self.code, code=self.code)
            self.manager.on_result(robot, result)


def rig(**options: object) -> tuple[Bot, CommandDispatcher, TeleopManager, ManualClock]:
    bot, clock = Bot(**options), ManualClock()
    commands = bot.manager = CommandDispatcher(bot.send)
    teleop = TeleopManager(bot.find, commands, LeaseTable(valid_s=3.0), bot.send, clock=clock)
    return bot, commands, teleop, clock


class Watched(dict[str, Any]):
    """A message that notes in which threads it is encoded."""

    threads: set[int]

    def items(self) -> Any:
        self.threads = {threading.get_ident()}
        return super().items()


async def test_what_is_long_is_encoded_in_a_thread_and_goes_before_what_was_said_after_it() -> None:
    bot, commands, _, clock = rig()
    fleet = FleetManager(bot.find, commands, LeaseTable(valid_s=3.0), clock=clock)
    turn, loop = asyncio.Lock(), {threading.get_ident()}
    for kind in ("publish", "call_service"):
        bot.frames.clear()
        long, short = Watched(), Watched()
        long["data" if kind == "publish" else "map_url"] = "long " * 10_000
        async with asyncio.TaskGroup() as group:
            for said in (long, short):
                if kind == "publish":
                    work = fleet.publish("r1", "/a", type_name="std_msgs/String", message=said, turn=turn)
                else:
                    name = "nav_msgs/srv/LoadMap"
                    work = fleet.call("r1", "/a", type_name=name, request=said, raw=True, turn=turn)
                group.create_task(work)
        sizes = [getattr(frame.command, kind).ByteSize() > 50_000 for frame in bot.frames]
        assert (sizes, long.threads == loop, short.threads == loop) == ([True, False], False, True), kind


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, MAX_TIMEOUT_S + 1, float("nan")])
async def test_a_call_without_end_or_time_is_refused_before_its_robot(timeout_s: float) -> None:
    bot, commands, _, clock = rig()
    fleet = FleetManager(bot.find, commands, LeaseTable(valid_s=3.0), clock=clock)
    with pytest.raises(InvalidRequestError, match="timeout_s is more than 0 and at most"):
        await fleet.call("r1", "/a", type_name="std_srvs/srv/Trigger", request={}, timeout_s=timeout_s)
    assert bot.frames == []


@pytest.mark.parametrize(
    ("message", "large"),
    [
        ({"data": "a" * 30_000}, False),
        ({"data": [0.5] * 4_000}, False),
        ({"data": "a" * 33_000}, True),
        ({"a": {"b": ["a" * 11_000] * 3}}, True),
        ({"data": [0.5] * 5_000}, True),
        ([[[]] * 70] * 70, True),
        (None, False),
    ],
)
def test_what_is_long_is_reported_by_its_texts_and_numbers(message: Any, large: bool) -> None:
    assert is_large(message) is large


async def test_results_find_their_command_only() -> None:
    bot, commands, _, _ = rig(code=None)
    task = asyncio.create_task(commands.run("r1", link_pb2.Command(), timeout_s=60))
    await asyncio.sleep(0)
    command_id = bot.frames[0].command.command_id
    commands.on_result("r2", link_pb2.CommandResult(command_id=command_id, ok=True))
    commands.on_result("r1", link_pb2.CommandResult(command_id=b"other", ok=True))
    await asyncio.sleep(0)
    assert not task.done()
    commands.on_result("r1", link_pb2.CommandResult(command_id=command_id, code="busy", message="later"))
    with pytest.raises(CommandRefusedError, match="later") as caught:
        await task
    assert caught.value.agent_code == "busy"


async def test_who_looks_leaves_room_and_nobody_is_kept_from_the_wheel() -> None:
    bot, commands, teleop, _ = rig(code=None)

    async def begin(count: int, *, look: bool) -> list[asyncio.Task[link_pb2.CommandResult]]:
        running = [commands.run("r1", link_pb2.Command(), timeout_s=60, look=look) for _ in range(count)]
        tasks = [asyncio.create_task(one) for one in running]
        await asyncio.sleep(0)
        return tasks

    tasks = await begin(LOOKS_PER_ROBOT, look=True)
    with pytest.raises(TooManyError):
        await commands.run("r1", link_pb2.Command(), timeout_s=60, look=True)
    tasks += await begin(PENDING_PER_ROBOT - LOOKS_PER_ROBOT, look=False)
    with pytest.raises(TooManyError):
        await commands.run("r1", link_pb2.Command(), timeout_s=60)
    bot.code = ""
    drive = await teleop.take("r1", "ann")
    await teleop.release(drive)
    assert bot.frames[-1].command.HasField("release_lease")
    commands.on_offline("r1")
    assert {type(one) for one in await asyncio.gather(*tasks, return_exceptions=True)} == {RobotOfflineError}


async def test_pending_commands_are_bounded_and_end_with_the_link() -> None:
    _, commands, _, _ = rig(code=None)
    tasks = [
        asyncio.create_task(commands.run("r1", link_pb2.Command(), timeout_s=60)) for _ in range(PENDING_PER_ROBOT)
    ]
    await asyncio.sleep(0)
    with pytest.raises(TooManyError):
        await commands.run("r1", link_pb2.Command(), timeout_s=60)
    commands.on_offline("r1")
    outcomes = await asyncio.gather(*tasks, return_exceptions=True)
    assert {type(outcome) for outcome in outcomes} == {RobotOfflineError}


async def test_an_idle_lease_is_taken_again_unless_somebody_else_did() -> None:
    bot, _, teleop, clock = rig()
    ann = await teleop.take("r1", "ann")
    clock.advance(10)
    await teleop.drive(ann, linear=0.1, angular=0.0)
    grants = [f.command.grant_lease.lease_id for f in bot.frames if f.HasField("command")]
    assert grants == [ann.lease_id] * 2
    clock.advance(10)
    bob = await teleop.take("r1", "bob")
    with pytest.raises(LeaseTakenError):
        await teleop.drive(ann, linear=0.1, angular=0.0)
    await teleop.release(ann)
    await teleop.drive(bob, linear=0.1, angular=0.0)


async def test_drives_are_numbered_and_finite() -> None:
    bot, _, teleop, _ = rig()
    drive = await teleop.take("r1", "ann")
    for speed in (0.1, 0.2):
        await teleop.drive(drive, linear=speed, angular=0.0)
    teleop.stop(drive)
    assert [f.teleop.seq for f in bot.frames if f.HasField("teleop")] == [1, 2, 3]
    with pytest.raises(InvalidRequestError):
        await teleop.drive(drive, linear=float("nan"), angular=0.0)


async def test_a_drive_command_is_as_old_as_its_driver_says_and_never_from_the_future() -> None:
    bot, _, teleop, clock = rig()
    drive = await teleop.take("r1", "anna")
    clock.advance(10.0)
    now_ns = clock.wall_ns()
    for sent_ns in (now_ns - 700_000_000, 0, now_ns + 1):
        await teleop.drive(drive, linear=0.1, angular=0.0, sent_ns=sent_ns)
    sent = [frame.teleop.sent_ns - now_ns for frame in bot.frames if frame.HasField("teleop")]
    assert sent == [-700_000_000, 0, 0]


async def test_a_stamped_topic_gets_stamped_commands() -> None:
    stamped = Channel(
        robot="r1", channel_id=1, topic="/r1/cmd_vel", schema_name=TWIST_STAMPED, type_hash=type_hash(TWIST_STAMPED)
    )
    bot, _, teleop, clock = rig(channels={"/r1/cmd_vel": stamped})
    await teleop.drive(await teleop.take("r1", "ann"), linear=0.5, angular=0.0)
    frame = bot.frames[-1].teleop
    message = codec(TWIST_STAMPED).decode(frame.payload)
    assert (frame.type_name, message.twist.linear.x) == (TWIST_STAMPED, 0.5)
    assert message.header.stamp.sec == clock.wall_ns() // 10**9


async def test_what_the_subscriptions_hear_decides_where_nobody_publishes() -> None:
    def hearing(*types: str) -> RobotGraph:
        ends = tuple(Endpoint("/controller", name, type_hash(name), "") for name in types)
        return RobotGraph(robot="r1", subscribers={"/r1/cmd_vel": ends})

    for types, sent in (((TWIST_STAMPED,), TWIST_STAMPED), ((TWIST,), TWIST), ((TWIST, TWIST_STAMPED), TWIST)):
        bot, _, teleop, _ = rig()
        teleop.use_graphs(lambda robot_id, types=types: hearing(*types))
        await teleop.drive(await teleop.take("r1", "ann"), linear=0.5, angular=0.0)
        assert bot.frames[-1].teleop.type_name == sent, types


async def test_a_refused_grant_leaves_the_robot_free() -> None:
    bot, _, teleop, _ = rig(code="unsupported")
    with pytest.raises(CommandRefusedError):
        await teleop.take("r1", "ann")
    bot.code = ""
    drive = await teleop.take("r1", "bob")
    teleop.on_offline("r1")
    assert drive.lost
    with pytest.raises(LeaseRequiredError):
        await teleop.drive(drive, linear=0.0, angular=0.0)
    bot.online = False
    await teleop.release(drive)


def test_types_of_robots_are_learned_from_their_schema() -> None:
    schema = b"int32 left\nint32 right\n"
    channel = Channel(
        robot="r1",
        channel_id=1,
        topic="/r1/wheels",
        schema_name="my_robot/msg/Wheels",
        type_hash="",
        schema_encoding="ros2msg",
        schema=schema,
    )
    payload, _ = TypeRegistry().encode("my_robot/msg/Wheels", {"left": 1, "right": 2}, channel)
    assert payload[4:] == b"\x01\x00\x00\x00\x02\x00\x00\x00"
    odd = Channel(
        robot="r1", channel_id=1, topic="/t", schema_name="std_msgs/msg/String", type_hash="RIHS01_0", encoding="cdr"
    )
    with pytest.raises(TypeHashError):
        TypeRegistry().encode("std_msgs/msg/String", {}, odd)


def test_short_type_names() -> None:
    assert full_type_name("std_msgs/String", "msg") == "std_msgs/msg/String"
    assert full_type_name("std_srvs/srv/Trigger", "srv") == "std_srvs/srv/Trigger"
    for bad in ("String", "a//b", "a/msg/", "std_srvs/srv/Trigger/x", "std_msgs/srv/String"):
        with pytest.raises(InvalidRequestError):
            full_type_name(bad, "msg")
