"""A program with `metaros.client` and a real robot: a real gateway, a real agent, nodes on a real router."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

from metaros.client import AsyncClient, Client, Sample
from metaros.errors import RefusedError
from metaros.idl import message_class
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.std_msgs.msg import String
from tests.edge_agent.conftest import Robot
from tests.edge_agent.conftest import robot as robot
from tests.gateway.harness import OPERATOR_KEY, running_gateway
from tests.support.nodes.counter import Counter
from tests.support.waiting import wait_until_async
from tests.system.robot.test_actions import agent

ADD = message_class("example_interfaces/srv/AddTwoInts")


async def test_a_program_and_a_robot(robot: Robot, zenoh_router: str, tmp_path: Path) -> None:
    def add(request: Any, response: Any) -> None:
        response.sum = request.a + request.b

    robot.node.create_service(ADD, "add", add)
    counter, said, speeds = Counter(robot.node), list[str](), list[float]()
    robot.node.create_subscription(String, "heard", lambda message: said.append(message.data), 10)
    robot.node.create_subscription(Twist, "cmd_vel", lambda message: speeds.append(message.linear.x), 10)
    publisher = robot.node.create_publisher(String, "chatter", 10)
    robot.node.create_timer(0.05, lambda: publisher.publish(String(data="from the robot")))
    async with running_gateway(tmp_path) as ready, agent(tmp_path, zenoh_router, ready.grpc_port):
        async with AsyncClient(ready.url, key=OPERATOR_KEY) as fleet, asyncio.timeout(60):
            await ready_to_be_asked(fleet)
            assert await fleet.call("sim_1", "add", {"a": 2, "b": 40}) == {"sum": 42}
            assert await asyncio.to_thread(blocking_call, ready.url) == {"sum": 1}
            async for sample in fleet.subscribe("chatter", robots="sim_1"):  # a live topic: nobody asked before
                assert isinstance(sample, Sample)
                assert sample.message.data == "from the robot"
                break
            while "hello" not in said:
                await fleet.publish("sim_1", "heard", String(data="hello"))
            await through_a_goal(fleet, counter)
            async with fleet.drive("sim_1") as drive:
                while 0.25 not in speeds:
                    await drive.move(linear=0.25)
                    await asyncio.sleep(0.02)
            await wait_until_async(lambda: speeds[-1] == 0.0)  # it stands


async def ready_to_be_asked(fleet: AsyncClient) -> None:
    """The robot has its link, and its graph has reached the gateway."""
    while True:
        try:
            if await fleet.call("sim_1", "add", {}) == {"sum": 0}:
                return
        except RefusedError as error:
            if error.reason not in ("unknown_robot", "unknown_service", "robot_offline", "unavailable"):
                raise
        await asyncio.sleep(0.05)


def blocking_call(url: str) -> Any:
    """The other client, in a thread."""
    with Client(url, key=OPERATOR_KEY) as fleet:
        return fleet.call("sim_1", "add", {"a": 1})


async def through_a_goal(fleet: AsyncClient, counter: Counter) -> None:
    """Feedback and result of one that succeeds; one that is cancelled."""
    goal = await fleet.send_goal("sim_1", "count", {"order": 2})
    counter.go.release()
    updates = []
    async for update in goal:
        updates.append(update)
        if update.kind == "feedback":
            counter.go.release()
    assert {"sequence": [0]} in [update.value for update in updates if update.kind == "feedback"]
    assert (updates[-1].kind, updates[-1].status, updates[-1].value) == ("result", "succeeded", {"sequence": [0, 1]})
    endless = await fleet.send_goal("sim_1", "count", {"order": 1000})
    async for update in endless:
        if update.status == "executing" and update.kind == "status":
            assert await endless.cancel()
    assert endless.status == "canceled"
