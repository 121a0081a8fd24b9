"""Services and actions of a real robot over REST: a real gateway, a real agent, nodes on a real router."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx

from edge_agent.config.settings import Settings as AgentSettings
from edge_agent.main import run_agent
from metaros.cdr import codec
from metaros.idl import message_class
from tests.edge_agent.conftest import Robot
from tests.edge_agent.conftest import robot as robot
from tests.gateway.harness import client, running_gateway
from tests.support.nodes.counter import Counter

BASE = "/api/v1/robots/sim_1"
ADD = message_class("example_interfaces/srv/AddTwoInts")


@asynccontextmanager
async def agent(folder: Path, router: str, grpc_port: int) -> AsyncIterator[None]:
    """The agent of sim_1, until the end of the block."""
    settings = AgentSettings(
        name="sim_1",
        namespace="/sim_1",
        gateway=f"grpc://127.0.0.1:{grpc_port}",
        zenoh_port=int(router.rpartition(":")[2]),
        host_metrics=False,
        state_dir=folder / "agent",
    )
    task = asyncio.create_task(run_agent(settings))
    try:
        yield
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)


async def until(http: httpx.AsyncClient, path: str, condition: Any) -> Any:
    """What is there as soon as that is so."""
    async with asyncio.timeout(60):
        while True:
            answer = await http.get(path)
            if answer.status_code == 200 and condition(answer.json()):
                return answer.json()
            await asyncio.sleep(0.02)


async def events_of(http: httpx.AsyncClient, goal: str) -> list[tuple[str, Any]]:
    """Every server-sent event of a goal, as a browser's EventSource reads them."""
    found, name = [], "message"
    async with http.stream("GET", f"{BASE}/goals/{goal}/feedback") as answer:
        assert answer.headers["content-type"].startswith("text/event-stream")
        async for line in answer.aiter_lines():
            if line.startswith("event: "):
                name = line[7:]
            elif line.startswith("data: "):
                found.append((name, json.loads(line[6:])))
    return found


async def test_services_and_goals_of_a_robot_over_rest(robot: Robot, zenoh_router: str, tmp_path: Path) -> None:
    def add(request: Any, response: Any) -> None:
        response.sum = request.a + request.b

    robot.node.create_service(ADD, "add", add)
    counter = Counter(robot.node)
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        assert (await http.get(f"{BASE}/graph")).json()["code"] == "unknown_robot"
        async with agent(tmp_path, zenoh_router, ready.grpc_port):
            ready_graph = {"/sim_1/count"}
            graph = await until(
                http, f"{BASE}/graph", lambda seen: ready_graph <= {item["action"] for item in seen["actions"]}
            )
            assert "/sim_1/base" in graph["nodes"]
            fleet = (await http.get("/api/v1/graph")).json()
            assert [one["robot"] for one in fleet["robots"]] == ["sim_1"]
            await services_by_name(http)
            await goals_by_name(http, counter)
            goal = await begun(http, order=3)
        # The agent is gone with its link: the goal is out of reach, not at its end, and no request hangs.
        away = await until(http, f"{BASE}/goals/{goal}", lambda seen: not seen["reachable"])
        assert (away["ended"], away["status"] in ("accepted", "executing")) == (False, True)
        refused = await http.post(f"{BASE}/goals/{goal}/cancel", json={})
        assert (refused.status_code, refused.json()["code"]) == (503, "robot_offline")
        async with agent(tmp_path, zenoh_router, ready.grpc_port):  # another process of it knows nothing of the goal
            events = await asyncio.wait_for(events_of(http, goal), 60)
            assert (events[-2][0], events[-2][1]["status"], events[-1][0]) == ("result", "lost", "end")
            assert "started anew" in (await http.get(f"{BASE}/goals/{goal}")).json()["message"]


async def services_by_name(http: httpx.AsyncClient) -> None:
    """JSON, CDR, relative and full names, the old route, and what there is not."""
    listed = (await http.get(f"{BASE}/services")).json()["services"]
    assert next(item for item in listed if item["service"] == "/sim_1/add")["type"] == ADD.__metaros_name__
    asked = {"request": {"a": 2, "b": 40}}
    for path in ("services/add", "services/%2Fsim_1%2Fadd"):
        answer = await http.post(f"{BASE}/{path}", json=asked)
        assert answer.json() == {"response": {"sum": 42}}, answer.text
    old = await http.post(f"{BASE}/services/call", json={"service": "add", **asked})
    once = await http.post(f"{BASE}/services/add", json=asked, headers={"Idempotency-Key": "k1"})
    assert old.json() == once.json() == {"response": {"sum": 42}}
    body = codec(ADD.Request).encode(ADD.Request(a=1, b=2))
    answer = await http.post(f"{BASE}/services/add", content=body, headers={"Content-Type": "application/cdr"})
    assert answer.headers["content-type"] == "application/cdr"
    assert codec(ADD.Response).decode(answer.content).sum == 3
    missing = await http.post(f"{BASE}/services/other", json={})
    assert (missing.status_code, missing.json()["code"]) == (404, "unknown_service")
    wrong = await http.post(f"{BASE}/services/add", json={"request": {"c": 1}})
    assert (wrong.status_code, wrong.json()["code"]) == (400, "invalid_field")


async def begun(http: httpx.AsyncClient, *, order: int) -> str:
    """The id of a goal that was taken."""
    answer = await http.post(f"{BASE}/actions/count", json={"goal": {"order": order}})
    assert answer.status_code == 202, answer.text
    goal = str(answer.json()["goal"])
    assert answer.headers["location"] == f"{BASE}/goals/{goal}"
    return goal


async def goals_by_name(http: httpx.AsyncClient, counter: Counter) -> None:
    """Feedback to the result, a cancel, a refusal, and what there is not."""
    goal = await begun(http, order=2)
    following = asyncio.create_task(events_of(http, goal))
    for step in (1, 2):
        counter.go.release()
        await until(
            http,
            f"{BASE}/goals/{goal}",
            lambda seen, n=step: len((seen["feedback"] or {"sequence": ()})["sequence"]) >= n,
        )
    events = await asyncio.wait_for(following, 60)
    assert [name for name, _ in events][-2:] == ["result", "end"]
    assert events[-2][1]["result"] == {"sequence": [0, 1]}
    assert any(name == "feedback" for name, _ in events)
    goal = await begun(http, order=5)
    assert (await http.post(f"{BASE}/goals/{goal}/cancel", json={})).json() == {"canceling": True}
    assert (await until(http, f"{BASE}/goals/{goal}", lambda seen: seen["ended"]))["status"] == "canceled"
    refused = await http.post(f"{BASE}/actions/count", json={"goal": {"order": -1}})
    assert (refused.status_code, refused.json()["code"]) == (409, "goal_rejected")
    for path, code in (("actions/other", "unknown_action"), ("goals/none/cancel", "unknown_goal")):
        missing = await http.post(f"{BASE}/{path}", json={})
        assert (missing.status_code, missing.json()["code"]) == (404, code)
    assert len((await http.get(f"{BASE}/goals?limit=2")).json()["goals"]) == 2
