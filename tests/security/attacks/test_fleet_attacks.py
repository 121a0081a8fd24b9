"""Attacks on what runs a fleet, as somebody who is signed in, or a robot of the fleet, would make them.

Each is about rights or bounds that lie between two parts: the history of commands, twins, downloads, and whoever reads
what robots say. What one part alone holds is tested beside it.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Iterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.principal import Role
from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.fleet.twin import digest
from metaros.interfaces.rcl_interfaces.srv import GetParameters, ListParameters
from tests.gateway.harness import CONTROL, RING, ScriptedAgent, client, hear, open_socket, running_gateway, say
from tests.support.gateways.memory_authenticator import bearer
from tests.support.gateways.plain_http import FREE, PlainHttp, plain_http

pytestmark = pytest.mark.integration

VIEWER = RING.add(role=Role.VIEWER, name="viewer")
ADMIN = RING.add(role=Role.ADMIN, name="admin")
REMOTE = {role: RING.add(role=role, robots=("other_*",), name=f"{role.word} elsewhere") for role in Role if role}
LIDAR = {"nodes": {"lidar": {"allowed": "lidar"}}}
TWIST = {"topic": "cmd_vel", "type": "geometry_msgs/msg/Twist", "message": {}}


async def test_nobody_reads_a_drivers_lease_in_the_history(tmp_path: Path) -> None:
    """The id is all that a lease asks for: who reads it while somebody drives, drives."""
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        async with open_socket(ready, "/api/v1/robots/sim_1/teleop") as driver:
            await say(driver, op="take", holder="driver")
            command = (await agent.next("command")).command
            lease_id = command.grant_lease.lease_id
            await agent.answer(command)
            await hear(driver, "granted")
            body = {"kind": "publish", "request": {**TWIST, "lease_id": lease_id}, "timeout_s": 5.0}
            sending = asyncio.create_task(http.post("/api/v1/robots/sim_1/commands", json=body))
            command = (await agent.next("command")).command
            assert command.lease_id == lease_id
            await agent.answer(command)
            done = await sending
            assert done.json()["state"] == "done"
            async with client(ready, key=VIEWER) as viewer:
                for path in ("/api/v1/commands", f"/api/v1/commands/{done.json()['id']}"):
                    page = await viewer.get(path)
                    assert page.status_code == 200
                    assert "cmd_vel" in page.text
                    assert lease_id not in page.text


# What people of another scope ask of groups: none of it may reach, name or count the robot `sim_1`.
GROUPS: list[tuple[str, str, Any]] = [
    ("GET", "/api/v1/nodes", None),
    ("GET", "/api/v1/nodes?selector=robot=sim_1", None),
    ("GET", "/api/v1/twins", None),
    ("GET", "/api/v1/twins?selector=robot%20in%20(sim_1)", None),
    ("GET", "/api/v1/commands", None),
    ("GET", "/api/v1/commands?robot=sim_1", None),
    ("GET", "/api/v1/rollouts", None),
    ("PATCH", "/api/v1/twins?selector=", {"budget": {"bytes_per_s": 4321}}),
    ("PATCH", "/api/v1/twins?selector=robot=sim_1", {"budget": {"bytes_per_s": 4321}}),
    ("PATCH", "/api/v1/nodes/lidar?selector=", {"nice": 7}),
    ("PATCH", "/api/v1/nodes/lidar?selector=robot=sim_1", {"nice": 7}),
    ("POST", "/api/v1/nodes/stop", {"selector": "", "node": "lidar"}),
    ("POST", "/api/v1/nodes/restart", {"selector": "robot=sim_1", "node": "lidar"}),
    ("POST", "/api/v1/commands", {"selector": "", "kind": "set_uplink", "request": {"bytes_per_s": 5000}}),
    ("POST", "/api/v1/commands", {"selector": "robot=sim_1", "kind": "node_verb", "durable": True,
                                  "request": {"node": "lidar", "verb": "stop"}}),
    ("POST", "/api/v1/rollouts", {"selector": "robot=sim_1", "version": "9.9.9"}),
    ("POST", "/api/v1/updates/withdrawals", {"path": "nodes/lidar/1.0.zip"}),
    ("POST", "/api/v1/updates/online-keys", {"fresh": True}),
    ("POST", "/api/v1/updates/metadata", {"roots": []}),
    ("PUT", "/api/v1/templates/t", {"selector": "", "document": {"budget": {"bytes_per_s": 4321}}}),
]  # fmt: skip


async def test_groups_end_at_the_scope_of_whoever_names_them(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent, client(ready, key=ADMIN) as admin:
        assert (await admin.patch("/api/v1/robots/sim_1/twin", json=LIDAR)).status_code == 200
        before = (await admin.get("/api/v1/robots/sim_1/twin")).json()
        for role, key in REMOTE.items():
            async with client(ready, key=key) as somebody:
                for method, path, body in GROUPS:
                    answer = await somebody.request(method, path, json=body)
                    assert answer.status_code < 500, (role, path, answer.text)
                    said = json.dumps(answer.json()).replace("selector", "").replace("robot=sim_1", "")
                    assert "sim_1" not in said, (role, method, path, answer.text)
                    if method in ("POST", "PUT") and ("/updates" in path or "/templates" in path):
                        assert answer.status_code == 403, (role, path, answer.text)
        assert (await admin.get("/api/v1/robots/sim_1/twin")).json() == before
        assert (await admin.get("/api/v1/commands")).json()["commands"] == []
        assert (await admin.get("/api/v1/templates")).json()["templates"] == []
        assert not any(agent.frames[CONTROL].get_nowait().HasField("command") for _ in range(agent.frames[1].qsize()))


@asynccontextmanager
async def lying_robot(ready: Ready, answers: Iterator[bytes]) -> AsyncIterator[ScriptedAgent]:
    """A robot that answers every command with the next of these payloads."""
    async with ScriptedAgent(ready) as agent:

        async def answer() -> None:
            while True:
                await agent.answer((await agent.next("command", timeout_s=3600)).command, payload=next(answers))

        task = asyncio.create_task(answer())
        try:
            yield agent
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task


def asking(ready: Ready) -> AbstractAsyncContextManager[PlainHttp]:
    """A client for hundreds of questions."""
    return plain_http(ready.http_port, bearer(ADMIN))


async def wish_for_a_lidar(ready: Ready) -> None:
    """A node that the robot's answers may be about."""
    async with client(ready, key=ADMIN) as http:
        assert (await http.patch("/api/v1/robots/sim_1/twin", json=LIDAR)).status_code == 200


DEEP: Any = "x"
for _ in range(200):
    DEEP = [DEEP]
ODD = [None, True, -1, 1 << 63, 1.5, "", "\x00\x1b[2J", "x" * 5000, [], [[]], {}, {"a": {"b": []}}, DEEP]


def lies() -> Iterator[dict[str, Any]]:
    """Reports whose parts have wrong shapes, each in each place."""
    fields = ("state", "why", "pid", "restarts", "since_ns", "last_exit", "version", "waits_for", "lease_id", "nice",
              "quarantined", "crashes", "update", "migratable")  # fmt: skip
    for odd in ODD:
        sections = ("nodes", "agent", "parameters", "lifecycle", "budget", "troubles", "left_out")
        yield dict.fromkeys(sections, odd)
        yield {"nodes": {"lidar": odd, "": odd, "\x00": odd, "a/b": odd}}
        yield {"nodes": {"lidar": dict.fromkeys(fields, odd)}, "parameters": {"/sim_1/lidar": odd}}
        update = {"update": {"state": odd, "version": odd, "code": odd, "message": odd}}
        yield {"nodes": {"lidar": update}, "agent": update}
    yield {"nodes": {f"n{number}": {"state": "running"} for number in range(5000)}}


async def test_no_report_of_a_robot_breaks_what_people_read(tmp_path: Path) -> None:
    paths = ["/robots/sim_1/nodes", "/robots/sim_1/nodes/lidar", "/robots/sim_1/twin", "/nodes", "/twins", "/robots"]
    async with running_gateway(tmp_path, **FREE) as ready, ScriptedAgent(ready) as agent, asking(ready) as http:
        await wish_for_a_lidar(ready)
        for lie in lies():
            reported = json.dumps(lie).encode()
            report = link_pb2.TwinReport(
                revision=1, applied=1, state="applied", sha256=digest(b"{}"), reported=reported
            )
            await agent.send(CONTROL, twin=report)
            async with asyncio.timeout(60):
                while True:
                    said = json.loads((await http.request("GET", "/api/v1/robots/sim_1/twin"))[1])["reported"]
                    if said is not None and said["values"] == json.loads(reported):
                        break
            for path in paths:
                status, text = await http.request("GET", f"/api/v1{path}")
                assert status == 200, (path, reported[:300], text)


def payloads() -> list[bytes]:
    """What a robot could answer instead of what it was asked."""
    names, values = codec(ListParameters.Response), codec(GetParameters.Response)
    listed, got = ListParameters.Response(), GetParameters.Response()
    listed.result.names = ["", "\x00", "a" * 100_000, "a", "a"]
    found = [b"", b"{", b"[]", b"null", b"\xff" * 64, bytes(64), b"{}", names.encode(listed), values.encode(got)]
    for odd in ODD:
        found.append(json.dumps({"lines": odd, "cursor": odd, "more": odd, "crashes": odd}).encode())
        row = {
            "at_ns": odd,
            "text": odd,
            "reason": odd,
            "pid": odd,
            "ran_s": odd,
            "env": odd,
            "lines": odd,
            "argv": odd,
        }
        found.append(json.dumps({"lines": [row, odd], "cursor": "7", "crashes": [row, odd]}).encode())
    return found


@pytest.mark.parametrize("path", ["log", "crashes", "parameters", "lifecycle"])
async def test_no_answer_of_a_robot_breaks_what_people_read(tmp_path: Path, path: str) -> None:
    given = payloads()
    turn = [b""]

    def same() -> Iterator[bytes]:
        while True:
            yield turn[0]

    place, change = f"/api/v1/robots/sim_1/nodes/lidar/{path}", b'{"parameters": {"a": 1}}'
    async with running_gateway(tmp_path, **FREE) as ready, lying_robot(ready, same()), asking(ready) as http:
        await wish_for_a_lidar(ready)
        for payload in given:
            turn[0] = payload
            status, text = await http.request("GET", place)
            assert status in (200, 400, 409, 502), (payload[:200], text)
            if path == "parameters":
                status, text = await http.request("PATCH", place, change, {"Content-Type": "application/json"})
                assert status in (200, 400, 409, 502), (payload[:200], text)
