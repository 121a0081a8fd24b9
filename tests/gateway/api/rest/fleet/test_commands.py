"""Commands by REST against a real gateway and a scripted agent."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path
from typing import Any

import httpx
import pytest

from gateway.api.rest.fleet import orders
from gateway.domain.principal import Role
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.limits import LIMITS
from tests.gateway.harness import CONTROL, OPERATOR_KEY, RING, ScriptedAgent, client, running_gateway

SEND = "/api/v1/robots/sim_1/commands"
UPLINK = {"kind": "set_uplink", "request": {"bytes_per_s": 5000}}
OTHER = RING.add(role=Role.ADMIN, robots=("other_*",), name="elsewhere")


async def answered(agent: ScriptedAgent, asking: Any, **answer: Any) -> httpx.Response:
    """The response to a request whose command the agent answers."""
    task = asyncio.ensure_future(asking)
    command = (await agent.next("command")).command
    await agent.answer(command, **answer)
    response: httpx.Response = await task
    return response


async def test_an_immediate_command_is_over_in_its_answer_and_in_the_history(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        done = await answered(agent, http.post(SEND, json=UPLINK, headers={"Idempotency-Key": "one"}))
        assert (done.status_code, done.json()["state"]) == (200, "done")
        again = await http.post(SEND, json=UPLINK, headers={"Idempotency-Key": "one"})
        assert again.json() == {**done.json()}, "the same command, not sent again"
        other = {**UPLINK, "request": {"bytes_per_s": 6000}}
        conflict = await http.post(SEND, json=other, headers={"Idempotency-Key": "one"})
        assert (conflict.status_code, conflict.json()["code"]) == (409, "idempotency_conflict")
        failed = await answered(agent, http.post(SEND, json=UPLINK), code="busy")
        assert (failed.status_code, failed.json()["state"], failed.json()["code"]) == (200, "failed", "busy")
        call = {"service": "go", "type": "std_srvs/srv/Trigger", "request": {}}
        payload = codec("std_srvs/srv/Trigger_Response").encode(Trigger.Response(success=True, message="ok"))
        answer = await answered(agent, http.post("/api/v1/robots/sim_1/services/call", json=call), payload=payload)
        assert answer.json()["response"]["success"] is True

        async def history() -> list[dict[str, Any]]:
            return list((await http.get("/api/v1/commands?robot=sim_1")).json()["commands"])

        found = await history()
        for _ in range(1000):
            if len(found) == 3:
                break
            await asyncio.sleep(0.02)
            found = await history()
        assert [item["state"] for item in found] == ["done", "failed", "done"]
        assert found[0]["result"] == {"success": True, "message": "ok"}
        assert found[0]["issued_by"] == "test operator"
        page = (await http.get("/api/v1/commands?limit=2")).json()
        rest = (await http.get(f"/api/v1/commands?limit=2&before={page['next']}")).json()
        assert [*page["commands"], *rest["commands"]] == found
        async with client(ready, key=OTHER) as stranger:
            assert (await stranger.get("/api/v1/commands")).json()["commands"] == []
            one = await stranger.get(f"/api/v1/commands/{found[0]['id']}")
            assert (one.status_code, one.json()["code"]) == (404, "unknown_command")


async def test_pages_of_large_commands_are_short_and_go_on(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        async with ScriptedAgent(ready), ScriptedAgent(ready, "other_1", session=b"2" * 16):
            pass
        sent = []
        for number in range(6):
            path = SEND.replace("sim_1", "other_1") if number % 2 else SEND
            sent.append((await http.post(path, json={**UPLINK, "durable": True})).json()["id"])
        monkeypatch.setattr(orders, "LIMITS", replace(LIMITS, command_page_bytes=1))
        monkeypatch.setattr(orders, "MAX_LOOKS", 1)
        monkeypatch.setattr(orders, "MAX_LISTED", 1)  # as if one look were full of others' commands
        for key, expected, empty in ((OPERATOR_KEY, sent[::-1], 0), (OTHER, sent[5::-2], 3)):
            async with client(ready, key=key) as somebody:
                found, pages, before = [], 0, ""
                while before is not None:
                    page = (await somebody.get(f"/api/v1/commands?before={before}")).json()
                    found += [item["id"] for item in page["commands"]]
                    assert len(page["commands"]) <= 1
                    pages, before = pages + (not page["commands"]), page["next"]
                assert found == expected
                assert pages >= empty


async def test_a_durable_command_waits_for_its_robot(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        async with ScriptedAgent(ready):
            pass
        await offline(http)
        durable = {**UPLINK, "durable": True, "expires_s": 600}
        first, second = [(await http.post(SEND, json=durable)).json() for _ in range(2)]
        assert first["state"] == "issued"
        gone = (await http.request("DELETE", f"/api/v1/commands/{second['id']}", json={})).json()
        assert gone["state"] == "cancelled"
        async with ScriptedAgent(ready, number=2) as agent:
            sent = (await agent.next("command")).command
            assert sent.durable
            assert sent.expires_ns > sent.sent_ns
            late = await http.request("DELETE", f"/api/v1/commands/{first['id']}", json={})
            assert (late.status_code, late.json()["code"]) == (409, "command_delivered")
        async with ScriptedAgent(ready, number=3) as agent:  # the link was lost before the result
            again = (await agent.next("command")).command
            assert again.command_id == sent.command_id
            await agent.send(CONTROL, result=link_pb2.CommandResult(command_id=sent.command_id, running=True))
            await until_state(http, first["id"], "running")
            kept = link_pb2.CommandResult(command_id=sent.command_id, ok=True, kept=True)
            await agent.send(CONTROL, result=kept)
            assert (await agent.next("result_stored")).result_stored.command_id == sent.command_id
            await until_state(http, first["id"], "done")
            await agent.send(CONTROL, result=link_pb2.CommandResult(command_id=b"?" * 16, code="x", kept=True))
            assert (await agent.next("result_stored")).result_stored.command_id == b"?" * 16, "nobody's: forget it"
            waited = asyncio.ensure_future(http.post(f"{SEND}?wait_s=30", json=durable))
            third = (await agent.next("command")).command.command_id
            await agent.send(CONTROL, result=link_pb2.CommandResult(command_id=third, ok=True, kept=True))
            over = await waited
            assert (over.status_code, over.json()["state"]) == (200, "done"), "without waiting it is 202"


async def test_one_command_for_each_robot_that_is_named(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        async with ScriptedAgent(ready), ScriptedAgent(ready, "sim_2", session=b"2" * 16):
            pass
        body = {**UPLINK, "durable": True, "selector": "robot in (sim_1, sim_2)"}
        dry = (await http.post("/api/v1/commands", json={**body, "dry_run": True})).json()
        assert dry == {"commands": [], "refused": {}, "robots": ["sim_1", "sim_2"]}
        headers = {"Idempotency-Key": "all"}
        sent = [(await http.post("/api/v1/commands", json=body, headers=headers)).json() for _ in range(2)]
        ids = [[item["id"] for item in answer["commands"]] for answer in sent]
        assert ids[0] == ids[1]
        assert len(ids[0]) == 2
        wrong = await http.post("/api/v1/commands", json={**body, "selector": "=="})
        assert (wrong.status_code, wrong.json()["code"]) == (400, "selector_invalid")


async def test_a_recording_is_asked_for_by_its_own_manager(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        body = {"kind": "save_recording", "request": {"last_s": 5, "topics": ["/a/**"]}}
        done = (await http.post(SEND, json=body)).json()
        assert done["state"] == "done"
        found = (await http.get(f"/api/v1/recordings/{done['result']['recording']}")).json()
        assert (found["robot"], found["topics"]) == ("sim_1", ["/a/**"])
        assert (await agent.next("command")).command.save_recording.recording_id == found["id"]
        failed = (await http.post(SEND, json={**body, "request": {"last_s": -5}})).json()
        assert (failed["state"], failed["code"]) == ("failed", "invalid_request")
        assert (await http.post(SEND, json={**body, "durable": True})).status_code == 400


async def test_requests_that_do_not_fit(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready):
        for body in (
            {"kind": "reboot"},
            {"kind": "set_uplink", "request": {}},
            {"kind": "set_uplink", "request": {"bytes_per_s": True}},
            {"kind": "set_uplink", "request": {"bytes_per_s": 1, "x": 1}},
            {"kind": "set_uplink", "request": {"bytes_per_s": 2**64}},
            {
                "kind": "publish",
                "request": {"topic": "x", "type": "std_msgs/msg/Int8", "message": {"data": -(2**63) - 1}},
            },
            {"kind": "node_verb", "request": {"node": "a", "verb": "explode"}},
            {"kind": "publish", "request": {"topic": "x", "cdr": "no base64"}},
            {**UPLINK, "durable": True, "expires_s": 10**9},
        ):
            answer = await http.post(SEND, json=body)
            assert (answer.status_code, answer.json()["code"]) == (400, "invalid_request"), body
        key = await http.post(SEND, json=UPLINK, headers={"Idempotency-Key": "x" * 300})
        assert key.status_code == 400
        publish, cdr = "/api/v1/robots/sim_1/publish", {"Content-Type": "application/cdr"}
        nowhere = await http.post(f"{publish}?type=std_msgs/msg/Int8", content=b"\0\1\0\0\5", headers=cdr)
        assert (nowhere.status_code, nowhere.json()["code"]) == (400, "invalid_request")
        assert nowhere.json()["detail"] == "a CDR body needs the query parameter topic"
        assert (await http.get("/api/v1/commands")).json()["commands"] == []


async def offline(http: httpx.AsyncClient) -> None:
    """Until the gateway has noticed."""
    for _ in range(1000):
        if (await http.get("/api/v1/robots/sim_1")).json()["state"] == "offline":
            return
        await asyncio.sleep(0.02)


async def until_state(http: httpx.AsyncClient, command_id: str, state: str) -> None:
    """Until the command is in it."""
    found = ""
    for _ in range(1000):
        found = (await http.get(f"/api/v1/commands/{command_id}")).json()["state"]
        if found == state:
            return
        await asyncio.sleep(0.02)
    raise AssertionError(found)
