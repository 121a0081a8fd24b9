"""`Idempotency-Key`: sent again, it is not done again, by the robot or by the gateway."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import httpx

from metaros.cdr import codec
from metaros.idl.json import from_json
from metaros.interfaces.geometry_msgs.msg import Twist
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.limits import LIMITS
from tests.gateway.api.rest.accounts.test_auth import local_key
from tests.gateway.api.rest.fleet.test_commands import answered
from tests.gateway.harness import ScriptedAgent, client, running_gateway

BASE = "/api/v1/robots/sim_1"
STRING = "std_msgs/msg/String"
PUBLISH = {"topic": "say", "type": STRING, "message": {"data": "once"}}
CALL = {"service": "go", "type": "std_srvs/srv/Trigger", "request": {}}
YES = codec("std_srvs/srv/Trigger_Response").encode(Trigger.Response(success=True, message="ok"))
FIBONACCI = "example_interfaces/action/Fibonacci"
KEY = {"Idempotency-Key": "mine"}


def accepted(yes: bool) -> bytes:
    """What an action's server answers to a goal."""
    return codec(f"{FIBONACCI}_SendGoal_Response").encode(
        from_json(f"{FIBONACCI}_SendGoal_Response", {"accepted": yes})
    )


async def nothing_more(agent: ScriptedAgent, http: httpx.AsyncClient) -> None:
    """Whatever was sent to the robot before this has come: it is the next command that the robot sees."""
    marker = {"service": "marker", "type": "std_srvs/srv/Trigger", "request": {}}
    task = asyncio.ensure_future(http.post(f"{BASE}/services/call", json=marker))
    command = (await agent.next("command")).command
    assert command.call_service.service == "/sim_1/marker", command
    await agent.answer(command, payload=YES)
    assert (await task).status_code == 200


SENT: tuple[tuple[str, str, dict[str, Any], bytes], ...] = (  # method, path, body, what the robot answers
    ("POST", "publish", PUBLISH, b""),
    ("POST", "services/call", CALL, YES),
    ("PUT", "uplink", {"bytes_per_s": 5000}, b""),
)


async def test_the_same_again_is_answered_as_the_first_was(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        for method, path, body, payload in SENT:
            url, key = f"{BASE}/{path}", {"Idempotency-Key": path}
            first = await answered(agent, http.request(method, url, json=body, headers=key), payload=payload)
            assert first.status_code == 200, first.text
            again = await http.request(method, url, json=body, headers=key)
            assert (again.status_code, again.json()) == (200, first.json()), path
            await nothing_more(agent, http)
            changed = {**body, **({"bytes_per_s": 6000} if path == "uplink" else {"lease_id": "another"})}
            other = await http.request(method, url, json=changed, headers=key)
            assert (other.status_code, other.json()["code"]) == (409, "idempotency_conflict"), path
            free = await answered(agent, http.request(method, url, json=body), payload=payload)
            assert free.json() == first.json(), "without a key it is another one"


async def test_cdr_a_failure_and_two_at_once(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        query = {"topic": "elsewhere", "type": "geometry_msgs/msg/Twist"}
        headers = {**KEY, "Content-Type": "application/cdr"}
        cdr = codec("geometry_msgs/msg/Twist").encode(Twist())
        asking = http.post(f"{BASE}/publish", content=cdr, params=query, headers=headers)
        failed = await answered(agent, asking, code="out_of_scope")
        assert (failed.status_code, failed.json()["code"]) == (403, "out_of_scope")
        again = await http.post(f"{BASE}/publish", content=cdr, params=query, headers=headers)
        assert (again.status_code, again.json()) == (403, failed.json()), "a failure stays one under its key"
        key = {"Idempotency-Key": "two"}
        both = [asyncio.ensure_future(http.post(f"{BASE}/services/call", json=CALL, headers=key)) for _ in range(2)]
        await agent.answer((await agent.next("command")).command, payload=YES)
        answers = [await one for one in both]
        assert {answer.text for answer in answers} == {answers[0].text}
        assert answers[0].json()["response"] == {"success": True, "message": "ok"}
        await nothing_more(agent, http)
        large = {**PUBLISH, "message": {"data": "x" * LIMITS.command_request_bytes}}
        answer = await http.post(f"{BASE}/publish", json=large, headers={"Idempotency-Key": "large"})
        assert (answer.status_code, answer.json()["code"]) == (413, "body_too_large")


async def test_a_recording_is_asked_for_once(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        async with ScriptedAgent(ready):
            pass  # known; a recording waits for its robot
        first, again = [
            await http.post(f"{BASE}/recordings", json={"last_s": 5, "topics": ["a"]}, headers=KEY) for _ in range(2)
        ]
        assert (first.status_code, again.json()["id"]) == (202, first.json()["id"])
        assert first.headers["location"] == again.headers["location"]
        assert len((await http.get("/api/v1/recordings")).json()["recordings"]) == 1
        span = await http.post(f"{BASE}/recordings", json={"start": "-5s"}, headers={"Idempotency-Key": "b"})
        assert (span.status_code, span.json()["code"]) == (400, "invalid_request")


async def test_a_goal_is_sent_once(tmp_path: Path) -> None:
    asked = {"type": FIBONACCI, "goal": {"order": 3}}
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:

        async def ask(action: str = "count", key: str = "mine", **changed: Any) -> httpx.Response:
            path = f"{BASE}/actions/{action}"
            return await http.post(path, json={**asked, **changed}, headers={"Idempotency-Key": key})

        assert (await ask(goal={"order": "x"})).status_code == 400
        first = asyncio.ensure_future(ask())
        command = (await agent.next("command")).command
        early = await ask()
        assert (early.status_code, early.json()["code"]) == (409, "idempotency_conflict"), "nobody knows yet"
        await agent.answer(command, payload=accepted(True))
        made = await first
        assert made.status_code == 202, "what was refused leaves its key free"
        again = await ask()
        assert (again.status_code, again.json()) == (202, made.json())
        assert again.headers["location"] == made.headers["location"]
        for changed in ({"goal": {"order": 4}}, {"action": "other"}):
            other = await ask(**changed)
            assert (other.status_code, other.json()["code"]) == (409, "idempotency_conflict"), changed
        no = [(await answered(agent, ask(key="no"), payload=accepted(False))), await ask(key="no")]
        assert [(answer.status_code, answer.json()["code"]) for answer in no] == [(409, "goal_rejected")] * 2
        both = [asyncio.ensure_future(ask(key="two")) for _ in range(2)]
        await agent.answer((await agent.next("command")).command, payload=accepted(True))
        assert {(await one).status_code for one in both} <= {202, 409}
        failed = await answered(agent, ask(key="busy"), code="busy")
        assert failed.json()["code"] == "busy"
        assert (await ask(key="busy")).json()["code"] == "unknown_goal", "it may have come: it is not sent again"
        await nothing_more(agent, http)
        assert len((await http.get(f"{BASE}/goals")).json()["goals"]) == 3


async def test_a_user_is_made_once(tmp_path: Path) -> None:
    asked = {"name": "ada", "role": "viewer", "robots": ["r1"], "password": "correct horse battery"}
    async with running_gateway(tmp_path) as ready, client(ready, key=local_key(ready)) as http:

        async def ask(key: str = "mine", **changed: Any) -> httpx.Response:
            return await http.post("/api/v1/users", json={**asked, **changed}, headers={"Idempotency-Key": key})

        assert (await ask(name="No Name")).json()["code"] == "invalid_request"
        made = await ask()
        assert made.status_code == 201, "what was refused leaves its key free"
        await http.patch("/api/v1/users/ada", json={"role": "operator"})
        again = await ask()
        assert (again.status_code, again.json()) == (201, {**made.json(), "role": "operator"}), "as they are now"
        for changed in ({"name": "bob"}, {"role": "operator"}, {"password": "another long password"}):
            other = await ask(**changed)
            assert (other.status_code, other.json()["code"]) == (409, "idempotency_conflict"), changed
        assert [user["name"] for user in (await http.get("/api/v1/users")).json()["users"]] == ["ada"]
        assert (await ask(key="new")).json()["code"] == "user_exists"
        assert (await ask(key="x" * 201)).json()["code"] == "invalid_request"
        await http.delete("/api/v1/users/ada")
        assert (await ask()).status_code == 404, "who is gone is not made again"
        stored = b"".join(file.read_bytes() for file in ready.data_dir.rglob("*") if file.is_file())
        assert b"mine" in stored
        assert b"correct horse" not in stored
