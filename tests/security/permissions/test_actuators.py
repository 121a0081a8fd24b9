"""Every endpoint to an actuator, in every state of the lease: refused unless lease and stamp are good.

A real gateway and a real agent in this process; what counts is what the robot's base hears. Each case is run twice:
with a gateway that checks the lease itself, and with one that lets everything through, so that only the agent stands
in the way. A new endpoint is a new row of ENDPOINTS.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json
import struct
import uuid
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import grpc
import httpx
import pytest

from edge_agent.config.settings import Settings as AgentSettings
from edge_agent.main import run_agent
from gateway.main import Ready
from metaros._proto import fleet_pb2, fleet_pb2_grpc, telemetry_pb2, telemetry_pb2_grpc
from metaros.cdr import codec
from metaros.clock import SystemClock
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.node.action import ServerGoal
from tests.edge_agent.conftest import Robot
from tests.edge_agent.conftest import robot as robot
from tests.gateway.api.foxglove.viewer import viewing
from tests.gateway.harness import OPERATOR_KEY, ScriptedAgent, client, open_socket, running_gateway
from tests.support.gateways.memory_authenticator import bearer
from tests.support.nodes.counter import FIBONACCI

TWIST = "geometry_msgs/msg/Twist"
BASE = "/api/v1/robots/sim_1"
OLD_NS = 2 * 10**9
METADATA = tuple((name.lower(), value) for name, value in bearer(OPERATOR_KEY).items())


@dataclass
class World:
    """Gateway, agent, and what the base heard."""

    ready: Ready
    http: httpx.AsyncClient
    fleet: fleet_pb2_grpc.FleetServiceStub
    telemetry: telemetry_pb2_grpc.TelemetryServiceStub
    heard: list[float]
    speeds: Iterator[int] = field(default_factory=lambda: itertools.count(1))

    async def take(self, holder: str = "me") -> str:
        """A living lease's id, whoever held it before: that one has run out by then."""
        while True:
            try:
                lease = await self.fleet.AcquireLease(
                    fleet_pb2.AcquireLeaseRequest(robot="sim_1", holder=holder), metadata=METADATA
                )
            except grpc.aio.AioRpcError as error:
                if code_of(error) not in ("lease_taken", "robot_offline"):
                    raise
                await asyncio.sleep(0.1)
            else:
                return str(lease.lease_id)

    async def release(self, lease_id: str) -> None:
        """Give it back."""
        await self.fleet.ReleaseLease(
            fleet_pb2.ReleaseLeaseRequest(robot="sim_1", lease_id=lease_id), metadata=METADATA
        )


Endpoint = Callable[[World, float, str, int], Awaitable[str]]


def code_of(error: grpc.aio.AioRpcError) -> str:
    """The stable code of a refused call."""
    return str(dict(error.trailing_metadata() or ()).get("metaros-code", ""))


def cdr(speed: float) -> bytes:
    message = Twist()
    message.linear.x = speed
    return codec(TWIST).encode(message)


def tenths(speed: float) -> int:
    """A speed as the goals of the action cmd_vel have it."""
    return round(speed * 10)


def code(answer: httpx.Response) -> str:
    document = answer.json()
    return str(document.get("code", "")) if answer.status_code != 202 else "accepted"


async def rest_json(world: World, speed: float, lease: str, sent_ns: int) -> str:
    message = {"linear": {"x": speed}}
    body = {"topic": "cmd_vel", "type": TWIST, "message": message, "lease_id": lease, "sent_ns": sent_ns}
    return code(await world.http.post(f"{BASE}/publish", json=body))


async def rest_once(world: World, speed: float, lease: str, sent_ns: int) -> str:
    body = {"topic": "cmd_vel", "type": TWIST, "message": {"linear": {"x": speed}}, "lease_id": lease}
    headers = {"Idempotency-Key": uuid.uuid4().hex}
    answers = [
        code(await world.http.post(f"{BASE}/publish", json={**body, "sent_ns": sent_ns}, headers=headers))
        for _ in range(2)  # the second one is a memory of the first, whatever the lease is by then
    ]
    assert answers[0] == answers[1] or answers[1] == "lease_required"
    return answers[0]


async def rest_full_name(world: World, speed: float, lease: str, sent_ns: int) -> str:
    body = {"topic": "/sim_1/cmd_vel", "type": TWIST, "message": {"linear": {"x": speed}}, "lease_id": lease}
    return code(await world.http.post(f"{BASE}/publish", json={**body, "sent_ns": sent_ns}))


async def rest_cdr(world: World, speed: float, lease: str, sent_ns: int) -> str:
    query = {"topic": "cmd_vel", "type": TWIST, "lease_id": lease, "sent_ns": str(sent_ns)}
    headers = {"Content-Type": "application/cdr"}
    return code(await world.http.post(f"{BASE}/publish", content=cdr(speed), params=query, headers=headers))


def order(speed: float, lease: str, sent_ns: int) -> dict[str, Any]:
    request = {"topic": "cmd_vel", "type": TWIST, "message": {"linear": {"x": speed}}, "lease_id": lease}
    return {"kind": "publish", "request": request, "sent_ns": sent_ns}


async def rest_command(world: World, speed: float, lease: str, sent_ns: int) -> str:
    return code(await world.http.post(f"{BASE}/commands", json=order(speed, lease, sent_ns)))


async def rest_fleet_command(world: World, speed: float, lease: str, sent_ns: int) -> str:
    body = {**order(speed, lease, sent_ns), "selector": "robot=sim_1"}
    answer = (await world.http.post("/api/v1/commands", json=body)).json()
    return str((answer["commands"] or list(answer["refused"].values()))[0]["code"])


async def grpc_publish(world: World, speed: float, lease: str, sent_ns: int) -> str:
    request = telemetry_pb2.PublishRequest(
        robot="sim_1", topic="cmd_vel", type_name=TWIST, cdr=cdr(speed), lease_id=lease, sent_ns=sent_ns
    )
    try:
        await world.telemetry.Publish(request, metadata=METADATA)
    except grpc.aio.AioRpcError as error:
        return code_of(error)
    return ""


async def grpc_command(world: World, speed: float, lease: str, sent_ns: int) -> str:
    asked = json.dumps(order(speed, lease, sent_ns)["request"])
    request = fleet_pb2.SendCommandRequest(robot="sim_1", kind="publish", request_json=asked, sent_ns=sent_ns)
    try:
        return str((await world.fleet.SendCommand(request, metadata=METADATA)).code)
    except grpc.aio.AioRpcError as error:
        return code_of(error)


async def rosbridge_publish(world: World, speed: float, lease: str, sent_ns: int) -> str:
    async with open_socket(world.ready, "/rosbridge/sim_1") as socket:
        said = {"op": "publish", "id": "p", "topic": "/sim_1/cmd_vel", "type": TWIST, "lease_id": lease}
        message = {"linear": {"x": speed}}
        for request in ({"op": "set_level", "level": "info"}, {**said, "msg": message, "sent_ns": sent_ns}):
            await socket.send(json.dumps(request))
        status = json.loads(await asyncio.wait_for(socket.recv(), 60))
        assert (status["op"], status["id"]) == ("status", "p")
        return str(status.get("code", ""))


async def foxglove_publish(world: World, speed: float, lease: str, sent_ns: int) -> str:
    channel = {"id": 1, "topic": "/sim_1/cmd_vel", "encoding": "json", "schemaName": TWIST}
    async with viewing(world.ready, f"/sim_1?lease={lease}") as viewer:
        await viewer.say("advertise", channels=[channel])
        await viewer.socket.send(struct.pack("<BI", 1, 1) + json.dumps({"linear": {"x": speed}}).encode())
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(60.0):  # the protocol says nothing of what goes through
                while speed not in world.heard:
                    with contextlib.suppress(TimeoutError):
                        said = await asyncio.wait_for(viewer.socket.recv(), 0.02)
                        if isinstance(said, str) and (status := json.loads(said))["op"] == "status":
                            return str(status["message"]).rpartition("(")[2].rstrip(")")
    return ""


GOAL = "example_interfaces/action/Fibonacci"


async def rest_goal(world: World, speed: float, lease: str, sent_ns: int) -> str:
    body = {"type": GOAL, "goal": {"order": tenths(speed)}, "lease_id": lease, "sent_ns": sent_ns}
    return code(await world.http.post(f"{BASE}/actions/cmd_vel", json=body)).replace("accepted", "")


async def grpc_goal(world: World, speed: float, lease: str, sent_ns: int) -> str:
    goal = json.dumps({"order": tenths(speed)})
    request = telemetry_pb2.SendGoalRequest(
        robot="sim_1", action="cmd_vel", type_name=GOAL, json=goal, lease_id=lease, sent_ns=sent_ns
    )
    try:
        updates = [update async for update in world.telemetry.SendGoal(request, metadata=METADATA)]
    except grpc.aio.AioRpcError as error:
        return code_of(error)
    assert updates[-1].status == "succeeded", updates
    return ""


async def rosbridge_goal(world: World, speed: float, lease: str, sent_ns: int) -> str:
    said = {"op": "send_action_goal", "id": "g", "action": "/sim_1/cmd_vel", "action_type": GOAL, "lease_id": lease}
    async with open_socket(world.ready, "/rosbridge/sim_1") as socket:
        await socket.send(json.dumps({**said, "args": {"order": tenths(speed)}}))
        result = json.loads(await asyncio.wait_for(socket.recv(), 60))
    assert (result["op"], result["id"]) == ("action_result", "g")
    return "" if result["result"] else "lease_required" if "lease" in result["values"] else str(result["values"])


STAMPLESS = ("Foxglove publish", "rosbridge goal")  # do not say when they were made: they are made when they come
ENDPOINTS: dict[str, Endpoint] = {
    "REST publish": rest_json,
    "REST publish under a key": rest_once,
    "REST publish, full name": rest_full_name,
    "REST publish, CDR": rest_cdr,
    "REST command": rest_command,
    "REST command by selector": rest_fleet_command,
    "gRPC publish": grpc_publish,
    "gRPC command": grpc_command,
    "rosbridge publish": rosbridge_publish,
    "Foxglove publish": foxglove_publish,
    "REST goal": rest_goal,
    "gRPC goal": grpc_goal,
    "rosbridge goal": rosbridge_goal,
}


@pytest.fixture
def heard(robot: Robot) -> list[float]:
    """linear.x of what reaches the robot's base, zeros left out: they stop it; and what its action cmd_vel is told."""
    speeds: list[float] = []

    def execute(goal: ServerGoal) -> Any:
        speeds.append(goal.request.order / 10)
        goal.succeed()
        return FIBONACCI.Result()

    robot.node.create_action_server(FIBONACCI, "cmd_vel", execute)
    robot.node.create_subscription(Twist, "cmd_vel", lambda m: speeds.append(m.linear.x) if m.linear.x else None, 10)
    return speeds


@asynccontextmanager
async def world(folder: Path, router: str, heard: list[float], *, checks: bool) -> AsyncIterator[World]:
    async with AsyncExitStack() as stack:
        topics = {} if checks else {"actuator_topics": ()}
        ready = await stack.enter_async_context(running_gateway(folder, **topics))
        agent = AgentSettings(
            name="sim_1",
            namespace="/sim_1",
            gateway=f"grpc://127.0.0.1:{ready.grpc_port}",
            zenoh_port=int(router.rpartition(":")[2]),
            host_metrics=False,
            state_dir=folder / "agent",
        )
        task = asyncio.create_task(run_agent(agent))

        async def end() -> None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

        stack.push_async_callback(end)
        http = await stack.enter_async_context(client(ready))
        channel = await stack.enter_async_context(grpc.aio.insecure_channel(f"127.0.0.1:{ready.api_grpc_port}"))
        stubs = fleet_pb2_grpc.FleetServiceStub(channel), telemetry_pb2_grpc.TelemetryServiceStub(channel)
        made = World(ready, http, *stubs, heard)
        await until_online(made)
        yield made


async def until_online(made: World) -> None:
    """The agent has its link, and the base hears what is published."""
    while True:
        answer = await made.http.get(BASE)
        if answer.status_code == 200 and answer.json()["state"] == "online":
            return
        await asyncio.sleep(0.05)


async def until_driven(made: World, endpoint: Endpoint) -> None:
    """The good case: a fresh stamp gets through; on a busy machine one may come too late, or unheard."""
    speed, lease = float(next(made.speeds)), await made.take()
    for _ in range(200):
        said = await endpoint(made, speed, lease, SystemClock().wall_ns())
        if said == "lease_required":
            lease = await made.take()
        else:
            assert said in ("", "stale"), said
        await asyncio.sleep(0.05)
        if speed in made.heard:
            break
    await made.release(lease)
    assert speed in made.heard


async def another_robots_lease(made: World) -> str:
    """The id of a lease of robot sim_2, which has nothing to do with sim_1."""
    async with ScriptedAgent(made.ready, "sim_2", session=b"2" * 16) as agent:
        request = fleet_pb2.AcquireLeaseRequest(robot="sim_2", holder="me")
        asking = asyncio.ensure_future(made.fleet.AcquireLease(request, metadata=METADATA))
        await agent.answer((await agent.next("command")).command)
        return str((await asking).lease_id)


@pytest.mark.integration
@pytest.mark.parametrize("checks", [True, False], ids=["gateway checks", "agent alone"])
async def test_every_endpoint_in_every_state_of_the_lease(
    tmp_path: Path, zenoh_router: str, heard: list[float], checks: bool
) -> None:
    async with world(tmp_path, zenoh_router, heard, checks=checks) as made:
        remote = await another_robots_lease(made)
        for name, endpoint in ENDPOINTS.items():
            await until_driven(made, endpoint)
            allowed = len(heard)
            assert await endpoint(made, -1.0, "", 0) == "lease_required", f"{name} without a lease"
            lease = await made.take()
            assert await endpoint(made, -2.0, "guess", 0) == "lease_required", f"{name}, somebody else's lease"
            assert await endpoint(made, -2.5, remote, 0) == "lease_required", f"{name}, another robot's lease"
            if name not in STAMPLESS:
                assert await endpoint(made, -3.0, lease, SystemClock().wall_ns() - OLD_NS) == "stale", name
            assert len(heard) == allowed
            await made.release(lease)
            assert await endpoint(made, -4.0, lease, 0) == "lease_required", f"{name} after the lease was given back"
        gone = await made.take("sleeper")
        other = await made.take("other")  # which is to be had once the first has run out
        for name, endpoint in ENDPOINTS.items():
            assert await endpoint(made, -5.0, gone, 0) == "lease_required", f"{name} with an expired lease"
        await made.release(other)
        for name, endpoint in ENDPOINTS.items():
            assert await endpoint(made, -6.0, gone, 0) == "lease_required", (
                f"{name} with an expired lease, nobody drives"
            )
        await until_driven(made, rest_json)  # whatever was let through before this would be heard by now
        assert min(heard) > 0, heard


@pytest.mark.integration
async def test_the_wheels(tmp_path: Path, zenoh_router: str, heard: list[float]) -> None:
    """The two endpoints that take the lease themselves: a teleop socket, and a stream over gRPC."""
    async with world(tmp_path, zenoh_router, heard, checks=True) as made:
        async with open_socket(made.ready, f"{BASE}/teleop") as socket:

            async def say(**request: Any) -> dict[str, Any]:
                await socket.send(json.dumps(request))
                return dict(json.loads(await socket.recv()))

            assert (await say(op="drive", linear=-1.0, angular=0.0))["op"] == "error", "without a lease"
            lease = await made.take("other")
            assert (await say(op="take", holder="me"))["code"] == "lease_taken"
            await made.release(lease)
            assert (await say(op="take", holder="me"))["op"] == "granted"
            old_ns = SystemClock().wall_ns() - OLD_NS
            assert (await say(op="drive", linear=-2.0, angular=0.0, sent_ns=old_ns))["op"] == "ack"
            await made.take("other")  # once ours has run out
            lost = await say(op="drive", linear=-3.0, angular=0.0)
            assert (lost["op"], lost["code"]) == ("lost", "lease_taken")

        async def driving(*requests: fleet_pb2.DriveRequest) -> str:
            async def each() -> AsyncIterator[fleet_pb2.DriveRequest]:
                for request in requests:
                    yield request

            try:
                async for _ in made.fleet.Drive(each(), metadata=METADATA):
                    pass
            except grpc.aio.AioRpcError as error:
                return code_of(error)
            return ""

        first = fleet_pb2.DriveRequest(robot="sim_1", holder="me", linear=-4.0)
        lease = await made.take("other")
        assert await driving(first) == "lease_taken"
        await made.release(lease)
        first.sent_ns = SystemClock().wall_ns() - OLD_NS
        assert await driving(first) == ""
        while not any(speed > 0 for speed in heard):
            good = fleet_pb2.DriveRequest(robot="sim_1", holder="me", linear=0.5)
            assert await driving(good, good) == ""
        assert min(heard) > 0, heard


@pytest.mark.integration
async def test_what_drives_is_never_durable(tmp_path: Path, zenoh_router: str, heard: list[float]) -> None:
    for checks in (True, False):
        async with world(tmp_path / str(checks), zenoh_router, heard, checks=checks) as made:
            body = {**order(-1.0, await made.take(), 0), "durable": True}
            answer = await made.http.post(f"{BASE}/commands", json=body)
            if checks:
                assert (answer.status_code, code(answer)) == (400, "invalid_request")
            else:
                found = (await made.http.get(f"{answer.headers['location']}?wait_s=30")).json()
                assert (found["state"], found["code"]) == ("failed", "lease_required")
            call = {"service": "cmd_vel", "type": "std_srvs/srv/Trigger", "request": {}}
            answer = await made.http.post(f"{BASE}/services/call", json=call)
            assert code(answer) == "lease_required", "a service of an actuator's name"
            answer = await made.http.post(f"{BASE}/services/cmd_vel", json={"type": "std_srvs/srv/Trigger"})
            assert code(answer) == "lease_required", "the same by its own path"
            goal = {"type": "example_interfaces/action/Fibonacci", "goal": {"order": 1}}
            answer = await made.http.post(f"{BASE}/actions/cmd_vel", json=goal)
            assert code(answer) == "lease_required", "an action of an actuator's name"
    assert heard == []
