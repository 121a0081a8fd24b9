"""Commands and teleop through a running agent on a real router."""

from __future__ import annotations

import itertools
from itertools import pairwise
from pathlib import Path

import pytest

from edge_agent.commands.executed_ids import CommandLog
from edge_agent.commands.publishers import zero_message
from edge_agent.link.byte_budget_override import stored_limit
from edge_agent.outbox import OsDisk
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import SystemClock
from metaros.errors import UnknownTypeError
from metaros.idl import message_class, type_hash
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.std_msgs.msg import String
from metaros.interfaces.std_srvs.srv import Trigger
from tests.edge_agent.conftest import Rig, Robot
from tests.support.waiting import wait_until_async

TWIST = "geometry_msgs/msg/Twist"
CMD_VEL = "/sim_1/cmd_vel"


def twist(speed: float) -> bytes:
    message = Twist()
    message.linear.x = speed
    return codec(TWIST).encode(message)


def publish(topic: str, name: str, payload: bytes) -> link_pb2.PublishMessage:
    return link_pb2.PublishMessage(topic=topic, type_name=name, type_hash=type_hash(name), payload=payload)


def grant(rig: Rig, lease: str = "L", valid_ms: int = 60_000) -> bytes:
    return rig.command(grant_lease=link_pb2.GrantLease(lease_id=lease, holder="me", valid_ms=valid_ms))


def drive(rig: Rig, seq: int, speed: float, *, lease: str = "L", age_s: float = 0.0) -> None:
    teleop = link_pb2.Teleop(
        lease_id=lease,
        seq=seq,
        sent_ns=SystemClock().wall_ns() - round(age_s * 1e9),
        topic=CMD_VEL,
        type_name=TWIST,
        type_hash=type_hash(TWIST),
        payload=twist(speed),
    )
    rig.gateway.say(link_pb2.GatewayFrame(teleop=teleop))


async def drive_until_received(rig: Rig, speeds: list[float], *, first_seq: int = 1) -> None:
    """As a held pad does: one that a busy machine delivers late is too old to be obeyed."""
    seqs = itertools.count(first_seq)
    await wait_until_async(lambda: drive(rig, next(seqs), 0.4) or 0.4 in speeds, every_s=0.1)


@pytest.fixture
def speeds(robot: Robot) -> list[float]:
    """linear.x of what reaches the robot's base."""
    received: list[float] = []
    robot.node.create_subscription(Twist, "cmd_vel", lambda m: received.append(m.linear.x), 10)
    return received


async def test_publish_reaches_a_subscription(agent: Rig, robot: Robot) -> None:
    received: list[str] = []
    robot.node.create_subscription(String, "say", lambda message: received.append(message.data), 10)
    await agent.wait_channel("/sim_1/say")
    payload = codec(String).encode(String(data="hello"))
    result = await agent.result(agent.command(publish=publish("/sim_1/say", "std_msgs/msg/String", payload)))
    assert (result.ok, result.code) == (True, "")
    await wait_until_async(lambda: received == ["hello"])


async def test_names_outside_the_namespace_are_refused(agent: Rig) -> None:
    message = publish("/sim_2/say", "std_msgs/msg/String", b"")
    assert (await agent.result(agent.command(publish=message))).code == "out_of_scope"
    call = link_pb2.CallService(service="/sim_2/x", type_name="std_srvs/srv/Trigger", type_hash="x")
    assert (await agent.result(agent.command(call_service=call))).code == "out_of_scope"


async def test_a_service_is_called_and_absence_is_an_error(agent: Rig, robot: Robot) -> None:
    def answer(request: object, response: Trigger.Response) -> Trigger.Response:
        response.success, response.message = True, "done"
        return response

    robot.node.create_service(Trigger, "~/resume", answer)
    name = "std_srvs/srv/Trigger"
    request = codec("std_srvs/srv/Trigger_Request").encode(Trigger.Request())
    call = link_pb2.CallService(
        service="/sim_1/base/resume", type_name=name, type_hash=type_hash(name), request=request
    )
    result = await agent.result(agent.command(call_service=call))
    while not result.ok and result.code == "unavailable":  # the agent has not seen the service yet
        result = await agent.result(agent.command(call_service=call))
    assert result.ok, result.message
    response = codec("std_srvs/srv/Trigger_Response").decode(result.payload)
    assert (response.success, response.message) == (True, "done")
    call.service = "/sim_1/nobody"
    result = await agent.result(agent.command(call_service=call))
    assert result.code in ("unavailable", "timeout")


async def test_an_actuator_needs_the_lease_and_is_stopped_after_it(
    agent: Rig, robot: Robot, speeds: list[float]
) -> None:
    await agent.wait_channel(CMD_VEL)
    message = publish(CMD_VEL, TWIST, twist(0.5))
    assert (await agent.result(agent.command(publish=message))).code == "lease_required"
    assert (await agent.result(agent.command(publish=message, lease_id="guess"))).code == "lease_required"
    assert (await agent.result(grant(agent))).ok
    assert (await agent.result(agent.command(publish=message, lease_id="L"))).ok
    await wait_until_async(lambda: len(speeds) == 2)
    assert speeds == [0.5, 0.0]


async def test_teleop_drives_and_stops_once(agent: Rig, robot: Robot, speeds: list[float]) -> None:
    await agent.wait_channel(CMD_VEL)
    drive(agent, 1, 0.9)
    assert (await agent.result(grant(agent))).ok
    await drive_until_received(agent, speeds, first_seq=2)
    drive(agent, 2, 0.9)
    drive(agent, 10_000, 0.9, age_s=0.6)
    drive(agent, 10_001, 0.9, lease="other")
    await wait_until_async(lambda: 0.4 in speeds and speeds[-1] == 0.0)
    assert set(speeds) == {0.4, 0.0}
    assert all(pair != (0.0, 0.0) for pair in pairwise(speeds))  # on a slow machine it may stop in between, too


async def test_release_stops_at_once(agent: Rig, robot: Robot, speeds: list[float]) -> None:
    await agent.wait_channel(CMD_VEL)
    grant(agent)
    await drive_until_received(agent, speeds)
    agent.command(release_lease=link_pb2.ReleaseLease(lease_id="L"))
    await wait_until_async(lambda: speeds[-1] == 0.0)
    assert set(speeds) == {0.4, 0.0}


async def test_losing_the_gateway_stops_the_robot(agent: Rig, robot: Robot, speeds: list[float]) -> None:
    await agent.wait_channel(CMD_VEL)
    grant(agent)
    await drive_until_received(agent, speeds)
    await agent.gateway.stop()
    await wait_until_async(lambda: speeds[-1] == 0.0)
    assert set(speeds) == {0.4, 0.0}
    await agent.gateway.start()


async def test_a_command_runs_once(agent: Rig, robot: Robot) -> None:
    received: list[str] = []
    robot.node.create_subscription(String, "say", lambda message: received.append(message.data), 10)
    await agent.wait_channel("/sim_1/say")
    message = publish("/sim_1/say", "std_msgs/msg/String", codec(String).encode(String(data="x")))
    command = link_pb2.Command(command_id=b"once" * 4, publish=message)
    for _ in range(2):
        agent.gateway.say(link_pb2.GatewayFrame(command=command))
    await wait_until_async(lambda: len(agent.half.results) == 2)
    assert [result.code for result in agent.half.results] == ["", "duplicate"]
    await wait_until_async(lambda: received)
    assert received == ["x"]


async def test_an_unknown_command_and_bad_names_are_answered(agent: Rig) -> None:
    assert (await agent.result(agent.command())).code == "unsupported"
    message = link_pb2.PublishMessage(topic="/sim_1/a b", type_name="std_msgs/msg/String", type_hash="RIHS01_00")
    assert (await agent.result(agent.command(publish=message))).code == "invalid_name"


async def test_a_byte_budget_is_in_force_at_once_and_kept(agent: Rig, tmp_path: Path) -> None:
    set_uplink = link_pb2.SetUplink(bytes_per_s=50_000)
    assert (await agent.result(agent.command(set_uplink=set_uplink))).ok
    assert stored_limit(OsDisk(tmp_path / "agent")) == 50_000
    statistics = agent.half.statistics
    await wait_until_async(lambda: statistics[-1].link.budget_bytes_per_s == 50_000)
    refused = await agent.result(agent.command(set_uplink=link_pb2.SetUplink(bytes_per_s=5)))
    assert (refused.ok, refused.code) == (False, "usage")
    assert (await agent.result(agent.command(set_uplink=link_pb2.SetUplink()))).ok
    assert stored_limit(OsDisk(tmp_path / "agent")) == 0


async def test_executed_commands_are_on_disk_before_they_are_answered(agent: Rig, tmp_path: Path) -> None:
    payload = codec(String).encode(String(data="hello"))
    command_id = agent.command(publish=publish("/sim_1/say", "std_msgs/msg/String", payload))
    await agent.result(command_id)
    assert not CommandLog(OsDisk(tmp_path / "agent")).first_time(command_id)


@pytest.mark.parametrize("name", [TWIST, "geometry_msgs/msg/TwistStamped", "std_msgs/msg/Float64"])
def test_zero_is_the_default_value(name: str) -> None:
    assert codec(name).decode(zero_message(name)) == message_class(name)()


def test_an_unknown_type_has_no_zero() -> None:
    with pytest.raises(UnknownTypeError):
        zero_message("acme_msgs/msg/Jaw")


async def test_a_durable_command_runs_once_and_its_result_stays_until_it_is_stored(agent: Rig, robot: Robot) -> None:
    received: list[str] = []
    robot.node.create_subscription(String, "say", lambda message: received.append(message.data), 10)
    await agent.wait_channel("/sim_1/say")
    now_ns = SystemClock().wall_ns()
    durable = {"durable": True, "expires_ns": now_ns + 600 * 10**9}
    payload = codec(String).encode(String(data="once"))
    message = publish("/sim_1/say", "std_msgs/msg/String", payload)
    command_id = agent.command(publish=message, **durable)
    await wait_until_async(lambda: [r.kept for r in agent.half.results if r.command_id == command_id] == [False, True])
    results = [r for r in agent.half.results if r.command_id == command_id]
    assert [(r.running, r.ok, r.kept) for r in results] == [(True, False, False), (False, True, True)]
    repeat = link_pb2.Command(command_id=command_id, publish=message, sent_ns=now_ns, timeout_ms=30_000, **durable)
    agent.gateway.say(link_pb2.GatewayFrame(command=repeat))
    await wait_until_async(lambda: sum(r.command_id == command_id for r in agent.half.results) == 3)
    assert agent.half.results[-1] == results[-1], "the kept result, not `duplicate`"
    stored = link_pb2.ResultStored(command_id=command_id)
    agent.gateway.say(link_pb2.GatewayFrame(result_stored=stored))
    agent.gateway.say(link_pb2.GatewayFrame(command=repeat))

    def reported() -> list[str]:
        agent.gateway.say(link_pb2.GatewayFrame(command=repeat))
        return [r.code for r in agent.half.results if r.command_id == command_id and r.code]

    await wait_until_async(lambda: "interrupted" in reported())  # nobody asks again after ResultStored: it does not run
    late = agent.command(publish=message, durable=True, expires_ns=now_ns - 1)
    assert (await agent.result(late)).code == "expired"
    lease = agent.command(grant_lease=link_pb2.GrantLease(lease_id="L"), **durable)
    assert (await agent.result(lease)).code == "unsupported"
    drives = agent.command(publish=publish(CMD_VEL, TWIST, twist(1.0)), **durable)
    assert (await agent.result(drives)).code == "lease_required"
    await wait_until_async(lambda: received == ["once"])


async def test_what_moves_the_robot_has_to_be_fresh(agent: Rig, robot: Robot, speeds: list[float]) -> None:
    await agent.wait_channel(CMD_VEL)
    message = publish(CMD_VEL, TWIST, twist(0.7))
    assert (await agent.result(grant(agent))).ok
    for sent_ns in (0, SystemClock().wall_ns() - 10**9):
        assert (await agent.result(agent.command(publish=message, lease_id="L", sent_ns=sent_ns))).code == "stale"
    old = link_pb2.GrantLease(lease_id="M", holder="me", valid_ms=60_000)
    late = agent.command(grant_lease=old, sent_ns=SystemClock().wall_ns() - 60 * 10**9)
    assert (await agent.result(late)).code == "expired"
    assert (await agent.result(agent.command(publish=message, lease_id="M"))).code == "lease_required"
    call = link_pb2.CallService(service="/sim_1/x/cmd_vel", type_name="std_srvs/srv/Trigger", type_hash="x")
    assert (await agent.result(agent.command(call_service=call))).code == "lease_required"
    assert speeds == []
