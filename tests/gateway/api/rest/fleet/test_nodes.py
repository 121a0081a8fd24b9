"""Nodes by REST against a scripted robot: what lasts, what is told at once, who may, and what a robot may answer."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from gateway.domain.principal import Role
from gateway.fleet.nodes import logs, verbs
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.idl import message_class
from metaros.idl.json import from_json
from tests.gateway.harness import RING, client, running_gateway
from tests.gateway.node_robot import node_robot as robot
from tests.gateway.node_robot import obey

ADMIN_KEY = RING.add(role=Role.ADMIN, name="nodes admin")
VIEWER_KEY = RING.add(role=Role.VIEWER, name="nodes viewer")
SCOPED_KEY = RING.add(role=Role.OPERATOR, name="nodes scoped", robots=("a*",))
ROW = {"allowed": "lidar"}


@pytest.fixture(autouse=True)
def _asks_again_soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """A robot that refused is asked again, and a log is looked into, without letting a test wait for it."""
    monkeypatch.setattr(verbs, "AGAIN_S", 0.02)
    monkeypatch.setattr(logs, "PAUSE_S", (0.02, 0.05))


async def until(http: httpx.AsyncClient, path: str, holds: Callable[[Any], object]) -> Any:
    for _ in range(6000):  # reports travel by themselves
        if holds(body := (await http.get(path)).json()):
            return body
        await asyncio.sleep(0.01)
    raise AssertionError(body)


async def test_start_and_stop_last_and_the_robot_is_reported_at_once(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http:
        path = "/api/v1/robots/a1/nodes/lidar"
        async with robot(ready, "a1") as one:
            put = (await http.put(path, json=ROW)).json()
            assert (put["revision"], put["changes"][0]["new"]) == (1, {"lidar": ROW})
            node = await until(http, path, lambda body: body["in_step"] and body["reported"])
            assert (node["wanted"], node["state"], node["in_own"], node["desired"]["nice"]) == (
                "running",
                "running",
                True,
                0,
            )
            tried = (await http.post(path + "/stop?dry_run=true", json={})).json()
            assert (tried["outcome"], tried["told"], tried["changed"], one.verbs) == ("done", False, True, [])
            stopped = (await http.post(path + "/stop?reason=dirty", json={})).json()
            assert (stopped["outcome"], stopped["told"], stopped["revision"]) == ("done", True, 2)
            assert one.verbs == [("lidar", "stop", 0)]
            await until(http, path, lambda body: body["state"] == "stopped" and body["in_step"])
            again = (await http.post(path + "/stop", json={})).json()
            assert (again["changed"], again["revision"]) == (False, None)
            signal = (await http.post(path + "/signal", json={"signal": 10})).json()
            assert (signal["outcome"], one.verbs[-1]) == ("done", ("lidar", "signal", 10))
            history = (await http.get("/api/v1/robots/a1/twin/history")).json()["entries"]
            assert history[0]["reason"] == "dirty"
            kept = await until(http, "/api/v1/commands?robot=a1", lambda body: len(body["commands"]) == 3)
            assert kept["commands"][-1]["request"] == {"node": "lidar", "verb": "stop"}
        await until(http, path, lambda body: not body["online"])
        late = (await http.post(path + "/start", json={})).json()
        assert (late["outcome"], late["code"], late["changed"]) == ("pending", "robot_offline", True)
        gone = await http.post(path + "/restart", json={})
        assert (gone.status_code, gone.json()["code"]) == (503, "robot_offline")
        async with robot(ready, "a1", obey):
            await until(http, path, lambda body: body["online"] and body["state"] == "running")


async def test_a_start_waits_for_the_row_that_lets_the_node_run(tmp_path: Path) -> None:
    refusals = ["invalid_config", "invalid_config", ""]

    def answer(command: link_pb2.Command) -> tuple[bytes, str]:
        return b"", refusals.pop(0)

    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http:
        path = "/api/v1/robots/a1/nodes/lidar"
        async with robot(ready, "a1", answer) as one:
            await http.put(path, json={**ROW, "run": False})
            started = (await http.post(path + "/start", json={})).json()
            assert (started["outcome"], started["told"], refusals) == ("done", True, [])
            assert len(one.verbs) == 3
            refusals.append("supervisor")
            failed = await http.post(path + "/restart", json={})
            assert (failed.status_code, failed.json()["code"]) == (502, "supervisor")


async def test_a_restart_under_a_key_is_done_once(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http:
        path, key = "/api/v1/robots/a1/nodes/lidar", {"Idempotency-Key": "morning"}
        async with robot(ready, "a1") as one:
            await http.put(path, json=ROW)
            first, again = [(await http.post(path + "/restart", json={}, headers=key)).json() for _ in range(2)]
            assert first == again
            assert (first["outcome"], first["told"], one.verbs) == ("done", True, [("lidar", "restart", 0)])
            other = await http.post(path + "/signal", json={"signal": 1}, headers=key)
            assert (other.status_code, other.json()["code"]) == (409, "idempotency_conflict")
            unknown = await http.post("/api/v1/robots/a1/nodes/x/restart", json={}, headers=key)
            assert unknown.json()["code"] == "unknown_node"


async def test_a_group_is_changed_together_and_reported_one_by_one(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http:
        async with robot(ready, "a1") as one, robot(ready, "a2") as two, robot(ready, "b1") as other:
            template = {"selector": "robot in (a1, a2)", "document": {"nodes": {"lidar": ROW}}}
            await http.put("/api/v1/templates/lidars", json=template)
            await until(http, "/api/v1/nodes?node=lidar&state=running", lambda body: len(body["nodes"]) == 2)
            tried = (await http.post("/api/v1/nodes/stop?dry_run=true", json={"selector": "", "node": "lidar"})).json()
            assert (tried["robots"], tried["done"], one.verbs) == (2, 2, [])
            done = (await http.post("/api/v1/nodes/stop", json={"selector": "robot!=a2", "node": "lidar"})).json()
            assert [(item["robot"], item["outcome"], item["revision"]) for item in done["results"]] == [
                ("a1", "done", 2)
            ]
            assert (one.verbs, two.verbs, other.verbs) == ([("lidar", "stop", 0)], [], [])
            nice = (await http.patch("/api/v1/nodes/lidar?selector=", json={"nice": 5})).json()
            assert (nice["robots"], nice["changed"]) == (2, 2)
            bad = await http.patch("/api/v1/nodes/lidar?selector=", json={"nice": 50})
            assert (bad.status_code, bad.json()["code"]) == (400, "twin_invalid")
            nowhere = await http.post("/api/v1/nodes/stop", json={"selector": "robot=b1", "node": "lidar"})
            assert (nowhere.status_code, nowhere.json()["code"]) == (404, "unknown_node")

            async with client(ready, key=SCOPED_KEY) as scoped:
                seen = (await scoped.get("/api/v1/nodes")).json()["nodes"]
                assert {node["robot"] for node in seen} == {"a1", "a2"}
                assert (await scoped.get("/api/v1/robots/b1/nodes")).status_code == 404
            few = (await http.get("/api/v1/nodes?limit=1")).json()
            assert (len(few["nodes"]), few["more"]) == (1, True)


async def test_a_robot_can_be_without_what_a_template_brings(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http, robot(ready, "a1"):
        row = {**ROW, "nice": 5, "parameters": {"rate": 1}}
        document = {"nodes": {"lidar": row, "camera": {"allowed": "camera"}}}
        await http.put("/api/v1/templates/all", json={"selector": "", "document": document})
        path = "/api/v1/robots/a1/nodes/lidar"
        await http.put(path, json={"allowed": "lidar", "critical": True})
        desired = (await http.get(path)).json()["desired"]
        assert (desired["nice"], desired["parameters"], desired["critical"]) == (0, {}, True)
        gone = (await http.request("DELETE", path, json={})).json()
        assert gone["changes"][0]["verb"] == "remove"
        whole = (await http.get("/api/v1/robots/a1/twin")).json()
        assert (list(whole["desired"]["nodes"]), whole["own"]["nodes"]) == (["camera"], {"lidar": None})
        stale = await http.put(path, json=ROW, headers={"If-Match": '"0"'})
        assert (stale.status_code, stale.json()["code"]) == (412, "twin_changed")
        assert (await http.request("DELETE", path, json={})).json()["code"] == "unknown_node"


async def test_roles(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as admin, robot(ready, "a1"):
        path = "/api/v1/robots/a1/nodes/lidar"
        await admin.put(path, json=ROW)
        async with client(ready) as operator, client(ready, key=VIEWER_KEY) as viewer:
            patched = (await operator.patch(path, json={"nice": 3})).json()
            assert patched.get("changed") is True, patched
            for change in ({"allowed": "other"}, {"args": ["--x"]}):
                refused = await operator.patch(path, json=change)
                assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")
            assert (await operator.put(path, json={"bundle": "x", "version": "1.0"})).status_code == 403
            assert (await viewer.get(path)).status_code == 200
            for verb in ("start", "stop", "restart"):
                assert (await viewer.post(f"{path}/{verb}", json={})).status_code == 403
            assert (await viewer.post("/api/v1/nodes/stop", json={"selector": "", "node": "lidar"})).status_code == 403
            assert (await viewer.patch(path + "/parameters", json={"parameters": {"a": 1}})).status_code == 403


async def test_logs_and_crashes_of_a_robot_that_says_odd_things(tmp_path: Path) -> None:
    answers: list[bytes] = [
        b'{"lines": [{"at_ns": 1700000000000000001, "text": "up"}, 7, {"at_ns": "x"}], "cursor": "9", "more": 1}',
        b"[]",
        b'{"crashes": [{"at_ns": 5, "reason": "old"}, {"at_ns": -1, "reason": 9, "env": [], "lines": ["a", 3]}, "x"]}',
    ]

    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http:
        path = "/api/v1/robots/a1/nodes/lidar"
        async with robot(ready, "a1", lambda command: (answers.pop(0), "")) as one:
            await http.put(path, json=ROW)
            page = (await http.get(path + "/log?query=UP&backwards=true&cursor=44&max_bytes=300")).json()
            (line,) = page["lines"]
            assert (line["at_ns"], line["at"][:4], line["text"]) == ("1700000000000000001", "2023", "up")
            assert (page["cursor"], page["more"]) == ("9", False)
            asked = one.commands[-1].read_log
            assert (asked.query, asked.backwards, asked.cursor, asked.max_bytes) == ("UP", True, "44", 300)
            assert (await http.get(path + "/log")).json()["code"] == "peer"
            first, second = (await http.get(path + "/crashes")).json()["crashes"]
            assert (first["at"], first["reason"], first["lines"], second["reason"]) == (None, "", ["a", ""], "old")
            assert (await http.get(path + "/log?cursor=abc")).json()["code"] == "invalid_request"
            one.odd = {"lidar": {"state": ["x"], "pid": "7", "since_ns": 1 << 70}, "cam": 5, "x": {"state": None}}
            await one.report()
            shown = await until(http, "/api/v1/robots/a1/nodes", lambda body: len(body["nodes"]) == 2)
            lidar = shown["nodes"][0]["reported"]
            assert (lidar["state"], lidar["pid"], lidar["since"]) == ("", None, None)


async def test_a_tail_ends_with_the_robot_and_few_follow_at_a_time(tmp_path: Path) -> None:
    lines = iter(range(1000))

    def answer(command: link_pb2.Command) -> tuple[bytes, str]:
        number = next(lines)
        found = [{"at_ns": number + 1, "text": f"line {number}"}] if number < 2 else []
        return json.dumps({"lines": found, "cursor": str(number), "more": False}).encode(), ""

    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http:
        path = "/api/v1/robots/a1/nodes/lidar"
        seen: list[tuple[str, Any]] = []
        async with robot(ready, "a1", answer) as one:
            await http.put(path, json=ROW)
            async with http.stream(
                "GET", path + "/log/tail", headers={"Last-Event-ID": "77"}, params={"cursor": "5"}
            ) as tail:
                name = ""
                async for line in tail.aiter_lines():
                    key, _, value = line.partition(": ")
                    if key == "event":
                        name = value
                    elif key == "data":
                        seen.append((name, json.loads(value)))
                        if len(seen) == 2:
                            for lane in one.agent.lanes.values():
                                lane.cancel()
        texts = [line["text"] for _, data in seen[:-1] for line in data["lines"]]
        assert texts == ["line 0", "line 1"]
        assert (seen[-1][0], seen[-1][1]["code"]) == ("end", "robot_offline")
        assert one.commands[0].read_log.cursor == "77"

        lines = iter(range(10, 10_000))
        async with robot(ready, "a1", answer):
            await until(http, path, lambda body: body["online"])
            async with asyncio.timeout(60), _tails(http, path + "/log/tail", 8):
                ninth = await http.get(path + "/log/tail")
                assert (ninth.status_code, ninth.json()["code"]) == (429, "too_many")


@asynccontextmanager
async def _tails(http: httpx.AsyncClient, path: str, count: int) -> AsyncIterator[None]:
    if not count:
        yield
        return
    async with http.stream("GET", path) as tail:
        lines = tail.aiter_lines()
        while await anext(lines) != ":":  # then the first page was there: it has its place
            pass
        async with _tails(http, path, count - 1):
            yield


def service(command: link_pb2.Command, values: dict[str, Any]) -> tuple[bytes, str]:
    """What a parameter service of a node with one parameter, `rate` in 0..10, answers."""
    call = command.call_service
    kind = call.type_name.rsplit("/", 1)[1]
    request = codec(f"{call.type_name}_Request").decode(call.request)
    if not call.service.startswith("/a1/lidar/"):
        return b"", "unavailable"
    answers: dict[str, Any] = {
        "ListParameters": {"result": {"names": list(values), "prefixes": []}},
        "DescribeParameters": {
            "descriptors": [
                {
                    "name": name,
                    "type": 3 if name in values else 0,
                    "floating_point_range": [{"from_value": 0.0, "to_value": 10.0, "step": 0.0}],
                }
                for name in getattr(request, "names", [])
            ]
        },
        "GetParameters": {"values": [{"type": 3, "double_value": values[n]} for n in values]},
        "SetParameters": {"results": [{"successful": True, "reason": ""} for _ in getattr(request, "parameters", [])]},
    }
    if kind == "SetParameters":
        values.update({item.name: item.value.double_value for item in request.parameters})
    name = f"{call.type_name}_Response"
    return codec(name).encode(from_json(message_class(name), answers[kind])), ""


async def test_parameters_are_read_checked_set_and_kept(tmp_path: Path) -> None:
    values = {"rate": 1.0}
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http:
        path = "/api/v1/robots/a1/nodes/lidar"
        async with robot(ready, "a1", lambda command: service(command, values)) as one:
            await http.put(path, json=ROW)
            found = (await http.get(path + "/parameters")).json()
            assert found["node"] == "/a1/lidar"
            (rate,) = found["parameters"]
            assert (rate["type"], rate["value"], rate["floating_point_range"]["to"]) == ("double", 1.0, 10.0)
            assert "desired" not in rate

            before = len(one.commands)
            refused = (await http.patch(path + "/parameters", json={"parameters": {"rate": 11}})).json()["results"]
            assert (refused[0]["successful"], "0.0..10.0" in refused[0]["reason"]) == (False, True)
            tried = await http.patch(path + "/parameters?dry_run=true", json={"parameters": {"rate": 2}, "keep": True})
            assert (tried.json()["results"][0]["successful"], tried.json()["revision"]) == (True, 2)
            assert {item.call_service.type_name for item in one.commands[before:]} == {
                "rcl_interfaces/srv/DescribeParameters"
            }  # nothing was set
            body = {"parameters": {"rate": 4}, "keep": True}
            kept = (await http.patch(path + "/parameters?reason=faster", json=body)).json()
            assert (kept["results"][0]["successful"], kept["revision"], values) == (True, 2, {"rate": 4.0})
            twin = (await http.get("/api/v1/robots/a1/twin")).json()
            assert twin["own"]["parameters"] == {"/a1/lidar": {"rate": 4}}
            assert (await http.get(path + "/parameters")).json()["parameters"][0]["desired"] == 4
            other = await http.get(path + "/parameters?ros_name=/a1/other")
            assert (other.status_code, other.json()["code"]) == (503, "unavailable")
            assert (await http.get(path + "/parameters?ros_name=a//b")).json()["code"] == "invalid_name"
            managed = (await http.get(path + "/lifecycle?ros_name=/a1/other")).json()
            assert (managed["managed"], managed["state"]) == (False, "")
        await until(http, path, lambda body: not body["online"])
        assert (await http.patch(path + "/parameters", json={"parameters": {"rate": 5}})).status_code == 503
        later = (await http.patch(path + "/parameters", json={"parameters": {"rate": 5}, "keep": True})).json()
        assert (later["revision"], "kept for later" in later["results"][0]["reason"]) == (3, True)
