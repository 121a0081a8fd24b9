"""What a running gateway writes into its audit log, reads from it, and proves."""

from __future__ import annotations

import asyncio
import sqlite3
from pathlib import Path
from typing import Any

import httpx

from gateway.domain.principal import Role
from gateway.main import Ready
from gateway.store.sqlite import DATABASE
from tests.gateway.harness import OPERATOR_KEY, RING, ScriptedAgent, client, open_socket, running_gateway
from tests.support.gateways.memory_authenticator import KeyRing

ADMIN = RING.add(role=Role.ADMIN, name="test admin")
VIEWER = RING.add(role=Role.VIEWER, name="test viewer")


async def rows(ready: Ready, **query: Any) -> list[dict[str, Any]]:
    """The log, the newest row first."""
    async with client(ready, key=ADMIN) as http:
        answer = await http.get("/api/v1/audit", params={"limit": 1000, **query})
        assert answer.status_code == 200, answer.text
        return list(answer.json()["rows"])


async def proof(ready: Ready) -> dict[str, Any]:
    async with client(ready, key=ADMIN) as http:
        return dict((await http.get("/api/v1/audit/verify")).json())


async def set_budget(ready: Ready, key: str, robot: str = "sim_1") -> httpx.Response:
    async with client(ready, key=key) as http:
        return await http.put(f"/api/v1/robots/{robot}/uplink", json={"bytes_per_s": 5000})


async def test_a_change_has_its_row_before_its_answer(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        asking = asyncio.create_task(set_budget(ready, OPERATOR_KEY))
        await agent.answer((await agent.next("command")).command)
        assert (await asking).status_code == 200
        (row,) = await rows(ready)
        expected = {"kind": "key", "name": "test operator", "role": "operator", "address": "127.0.0.1"}
        asked = {"action": "robots.configure", "method": "PUT", "target": "/api/v1/robots/sim_1/uplink"}
        assert {key: row[key] for key in (*expected, *asked)} == {**expected, **asked}
        assert (row["status"], row["code"], row["number"]) == (200, "", 1)
        assert (await proof(ready))["ok"]


async def test_what_is_refused_has_its_row_and_reading_has_none(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        for key, status in ((OPERATOR_KEY, 404), (VIEWER, 403), ("", 401), ("mrk_wrong_key", 401)):
            assert (await set_budget(ready, key)).status_code == status
        async with client(ready, key=VIEWER) as http:
            assert (await http.get("/api/v1/robots")).status_code == 200
            assert (await http.get("/api/v1/audit")).status_code == 403
        found = (await rows(ready))[::-1]
        assert [(row["status"], row["code"], row["name"], row["action"]) for row in found] == [
            (404, "unknown_robot", "test operator", "robots.configure"),
            (403, "forbidden", "test viewer", "robots.configure"),
            (401, "sign_in", "anonymous", "robots.configure"),
            (401, "bad_credentials", "anonymous", "robots.configure"),
            (403, "forbidden", "test viewer", "audit.read"),
        ]
        for secret in (VIEWER, OPERATOR_KEY, "mrk_wrong_key"):
            assert secret not in str(found)


async def test_a_socket_that_drives(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready):
        async with open_socket(ready, "/api/v1/robots/sim_1/teleop"):
            pass
        async with open_socket(ready, "/api/v1/stream"):
            pass
        (row,) = await rows(ready)
        assert (row["action"], row["method"], row["status"]) == ("robots.drive", "SOCKET", 101)


async def test_users_keys_and_signing_in(tmp_path: Path) -> None:
    password = "correct horse battery"
    async with running_gateway(tmp_path) as ready:
        async with client(ready, key=ADMIN) as http:
            body = {"name": "ada", "role": "operator", "robots": ["sim_*"], "password": password}
            assert (await http.post("/api/v1/users", json=body)).status_code == 201
            async with client(ready, key=(ready.data_dir / "local.key").read_text().strip()) as local:
                made = (await local.post("/api/v1/keys", json={"name": "ci", "role": "viewer"})).json()
            assert (await http.patch("/api/v1/users/ada", json={"role": "viewer"})).status_code == 200
        async with client(ready, key="") as http:
            for said in ("wrong", password):
                await http.post("/api/v1/auth/login", json={"name": "ada", "password": said})
        found = (await rows(ready))[::-1]
        assert [(row["action"], row["name"], row["status"], row["code"]) for row in found] == [
            ("users.manage", "test admin", 201, ""),
            ("keys.own", "local", 201, ""),
            ("users.manage", "test admin", 200, ""),
            ("sessions.open", "anonymous", 401, "bad_credentials"),
            ("sessions.open", "ada", 200, ""),
        ]
        assert [row["detail"] for row in found][:3] == [
            "ada: operator, robots sim_*",
            f"key {made['id']} ci: viewer, robots *",
            "ada: viewer, robots sim_*",
        ]
        assert not {password, made["secret"], made["key"]} & {value for row in found for value in row.values()}
        assert password not in str(found)


async def test_pages_filters_and_many_at_once_in_one_chain(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        for number in range(5):
            await set_budget(ready, OPERATOR_KEY if number % 2 else ADMIN, f"r_{number}")
        first = (await http.get("/api/v1/audit?limit=3")).json()
        second = (await http.get(f"/api/v1/audit?limit=3&before={first['next']}")).json()
        assert [row["number"] for row in (*first["rows"], *second["rows"])] == [5, 4, 3, 2, 1]
        assert second["next"] is None
        assert [row["number"] for row in await rows(ready, name="test operator")] == [4, 2]
        assert await rows(ready, action="store.read") == []
        assert (await http.get("/api/v1/audit?name=a%00b")).json()["code"] == "invalid_request"
        budgets = [f"/api/v1/robots/r_{number}/uplink" for number in range(5, 60)]
        await asyncio.gather(*(http.put(path, json={"bytes_per_s": 5000}) for path in budgets))
        assert len(await rows(ready)) == 60
        found = await proof(ready)
        assert (found["ok"], found["rows"], found["faults"]) == (True, 60, [])


async def test_a_restart_goes_on_and_the_head_is_in_the_object_store(tmp_path: Path) -> None:
    for number in range(2):
        async with running_gateway(tmp_path) as ready:
            await set_budget(ready, OPERATOR_KEY, f"r_{number}")
    async with running_gateway(tmp_path) as ready:
        found = await proof(ready)
        assert (found["ok"], found["rows"], found["heads"], found["heads_sealed"]) == (True, 2, 2, 2)


async def test_a_log_that_was_changed(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        for number in range(3):
            await set_budget(ready, OPERATOR_KEY, f"r_{number}")
    with sqlite3.connect(tmp_path / "data" / DATABASE) as database:
        database.execute("DROP TRIGGER audit_no_update")
        database.execute("UPDATE audit SET name = 'somebody else', at_ns = 9e18 WHERE number = 2")
    database.close()
    async with running_gateway(tmp_path) as ready:
        found = await proof(ready)
        assert not found["ok"]
        assert [(fault["number"], fault["fault"]) for fault in found["faults"]] == [(2, "hash")]
        assert [row["name"] for row in await rows(ready)][1] == "somebody else"


async def test_a_refusal_of_nobody_known_is_seen(tmp_path: Path) -> None:
    ring = KeyRing()
    async with running_gateway(tmp_path, authenticator=ring, anonymous=False) as ready:
        async with client(ready, key="") as http:
            assert (await http.get("/api/v1/robots")).status_code == 401
        admin = (ready.data_dir / "local.key").read_text().strip()
        async with client(ready, key=admin) as http:
            found = (await http.get("/api/v1/audit")).json()["rows"]
        assert [(row["kind"], row["action"], row["code"]) for row in found] == [("anonymous", "robots.read", "sign_in")]
