"""A real robot behind a real gateway for clients of rosbridge: topics, a service, an action and a parameter."""

from __future__ import annotations

import asyncio
import json
import math
import threading
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

from edge_agent.config.settings import Settings
from edge_agent.main import run_agent
from gateway.main import Ready
from metaros.idl import message_class
from metaros.interfaces.sensor_msgs.msg import LaserScan
from metaros.interfaces.std_msgs.msg import String
from metaros.node.action import ServerGoal
from tests.edge_agent.conftest import Robot
from tests.gateway.harness import client, running_gateway

__all__ = ["ADD", "FIBONACCI", "BridgedRobot", "Script", "bridged_robot"]

FIBONACCI = message_class("example_interfaces/action/Fibonacci")
ADD = message_class("example_interfaces/srv/AddTwoInts")


class BridgedRobot:
    """/sim_1/base publishes chatter and scan, hears echo, serves add, counts for goals and has the parameter speed."""

    def __init__(self, robot: Robot, ready: Ready) -> None:
        self.ready = ready
        self.node = node = robot.node
        self.heard: list[str] = []
        node.create_subscription(String, "echo", lambda message: self.heard.append(message.data), 100)
        node.create_service(ADD, "add", self._add)
        node.create_action_server(FIBONACCI, "count", self._count, cancel=lambda goal: True)
        node.declare_parameter("speed", 1.5)
        chatter, scan = node.create_publisher(String, "chatter"), node.create_publisher(LaserScan, "scan")
        message = LaserScan(ranges=[1.0, math.nan, math.inf, *[2.0] * 200], range_max=9.5)

        def publish() -> None:
            chatter.publish(String(data="hello"))
            scan.publish(message)

        node.create_timer(0.1, publish)

    @staticmethod
    def _add(request: Any, response: Any) -> None:
        response.sum = request.a + request.b

    @staticmethod
    def _count(goal: ServerGoal) -> Any:
        """Counts to what is asked; beyond 100 until it is cancelled."""
        sequence: list[int] = []
        pause = threading.Event()
        while len(sequence) < goal.request.order:
            if goal.should_stop:
                result = FIBONACCI.Result(sequence=sequence[:5])
                if goal.is_cancel_requested:
                    goal.canceled(result)
                return result
            if len(sequence) < 100:
                sequence.append(len(sequence))
                goal.publish_feedback(FIBONACCI.Feedback(sequence=sequence))
            pause.wait(0.02)
        goal.succeed()
        return FIBONACCI.Result(sequence=sequence)


@asynccontextmanager
async def bridged_robot(robot: Robot, router: str, folder: Path) -> AsyncIterator[BridgedRobot]:
    """The robot, once the gateway knows its graph."""
    async with AsyncExitStack() as stack:
        ready = await stack.enter_async_context(running_gateway(folder))
        made = BridgedRobot(robot, ready)
        agent = Settings(
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
        known: dict[str, Any] = {}

        async def ask() -> bool:
            graph = await http.get("/api/v1/robots/sim_1/graph")
            topics = await http.get("/api/v1/robots/sim_1/topics")
            if graph.status_code == topics.status_code == 200:
                known.update(graph.json(), announced={item["topic"] for item in topics.json()["topics"]})
            actions = {item["action"] for item in known.get("actions", ())}
            services = {item["service"] for item in known.get("services", ())}
            return (
                "/sim_1/count" in actions
                and {"/sim_1/add", "/sim_1/base/list_parameters"} <= services
                and {"/sim_1/chatter", "/sim_1/scan"} <= known["announced"]
            )

        async with asyncio.timeout(60):
            while True:
                if await ask():
                    break
                await asyncio.sleep(0.1)
        yield made


class Script:
    """A client in a process of its own: it writes a JSON object a step, and goes on at a line of ours."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.steps: dict[str, Any] = {}

    @classmethod
    @asynccontextmanager
    async def running(cls, *command: str, **environment: str) -> AsyncIterator[Script]:
        """Start it; it is killed at the end, if it still runs."""
        pipe = asyncio.subprocess.PIPE
        process = await asyncio.create_subprocess_exec(
            *command, stdin=pipe, stdout=pipe, stderr=pipe, env=environment, limit=1 << 24
        )
        try:
            yield cls(process)
        finally:
            if process.returncode is None:
                process.kill()
            await process.wait()

    async def until(self, step: str, *, timeout_s: float = 90.0) -> Any:
        """What it says of a step; what it says of others before it is kept in `steps`."""
        assert self.process.stdout is not None
        async with asyncio.timeout(timeout_s):
            while step not in self.steps:
                line = await self.process.stdout.readline()
                if not line:
                    assert self.process.stderr is not None
                    errors = (await self.process.stderr.read()).decode()[-3000:]
                    raise AssertionError(f"it ended before {step!r}, after {self.steps}: {errors}")
                if line.startswith(b"{"):
                    self.steps.update(json.loads(line))
        return self.steps[step]

    async def go_on(self) -> None:
        """Let it do the next step."""
        assert self.process.stdin is not None
        self.process.stdin.write(b"go\n")
        await self.process.stdin.drain()
