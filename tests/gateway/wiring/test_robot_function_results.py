"""Functions on a robot behind a real agent: what they came to while the link was away is at the gateway afterwards."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx

from edge_agent.config.settings import Settings
from edge_agent.main import run_agent
from gateway.domain.principal import Role
from metaros.interfaces.std_msgs.msg import String
from tests.edge_agent.conftest import Robot, robot
from tests.gateway.harness import RING, client, running_gateway
from tests.support.functions.robot_function import running_function, write_function
from tests.support.ports import free_port
from tests.support.waiting import wait_until_async

__all__ = ["robot"]

COUNT = 25
ADMIN = RING.add(role=Role.ADMIN, name="robot functions")
ODD = """
def handler(event, context):
    number = int(event["detail"]["message"]["data"])
    if number == 7:
        raise ValueError("seven")
    return {"number": number}
"""
RULE = {
    "name": "robots-fail",
    "pattern": {"detail-type": ["metaros.function.result"], "detail": {"status": ["dead"], "function": ["odd"]}},
    "targets": [],
}


@asynccontextmanager
async def running_agent(router: str, grpc_port: int, folder: Path) -> AsyncIterator[None]:
    """The agent of sim_1."""
    agent = Settings(
        name="sim_1",
        namespace="/sim_1",
        gateway=f"grpc://127.0.0.1:{grpc_port}",
        zenoh_port=int(router.rpartition(":")[2]),
        host_metrics=False,
        state_dir=folder / "agent",
    )
    task = asyncio.create_task(run_agent(agent))
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def calls(http: httpx.AsyncClient, **query: Any) -> list[dict[str, Any]]:
    """The record of the robot's calls."""
    answer = await http.get("/api/v1/functions/odd/invocations", params={"kind": "robot", "limit": 200, **query})
    assert answer.status_code == 200, answer.text
    return list(answer.json()["invocations"])


async def until_calls(http: httpx.AsyncClient, count: int) -> list[dict[str, Any]]:
    """Once there are so many."""
    async with asyncio.timeout(60):
        while True:
            found = await calls(http)
            if len(found) >= count:
                return found
            await asyncio.sleep(0.1)


async def test_results_come_when_the_link_is_back(robot: Robot, zenoh_router: str, tmp_path: Path) -> None:
    grpc_port = free_port()
    words = robot.node.create_publisher(String, "word", 1000)
    package = write_function(tmp_path / "odd", ODD, name="odd", retry={"attempts": 1})
    async with (
        running_agent(zenoh_router, grpc_port, tmp_path),
        running_function(package, tmp_path / "state", zenoh_router),
    ):
        await wait_until_async(
            lambda: any(end.node_full_name == "/sim_1/function" for end in robot.node.graph.endpoints("/sim_1/word"))
        )
        async with running_gateway(tmp_path, grpc_port=grpc_port) as ready, client(ready, key=ADMIN) as http:
            made = await http.put("/api/v1/rules/robots-fail", json=RULE)
            assert made.status_code == 201, made.text
            words.publish(String(data="0"))
            await until_calls(http, 1)
        for number in range(1, COUNT):  # while there is no gateway
            words.publish(String(data=str(number)))
        async with running_gateway(tmp_path, grpc_port=grpc_port) as ready, client(ready, key=ADMIN) as http:
            found = await until_calls(http, COUNT)
            assert len({call["request_id"] for call in found}) == len(found) == COUNT
            assert {call["robot"] for call in found} == {"sim_1"}
            (failed,) = await calls(http, status="error")
            assert (failed["error_type"], failed["error_message"]) == ("ValueError", "seven")
            rule = (await http.get("/api/v1/rules/robots-fail")).json()
            assert rule["stats"]["fired"] == 1
            unknown = await http.get("/api/v1/functions/odd/invocations")
            assert unknown.status_code == 404  # it is no function of the gateway's
