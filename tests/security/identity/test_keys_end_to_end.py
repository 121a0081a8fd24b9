"""A key as a person makes, uses and revokes it: stored, scoped, and gone from every open socket."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from pathlib import Path

import pytest

from gateway.api import open_connections
from gateway.domain.principal import Role
from gateway.main import Ready
from metaros.limits import LIMITS
from tests.gateway.harness import ScriptedAgent, client, hear, open_socket, running_gateway, say
from tests.support.gateways.memory_authenticator import KeyRing


def local_key(ready: Ready) -> str:
    """Of whoever can read the data directory."""
    return (ready.data_dir / "local.key").read_text().strip()


async def test_a_key_of_some_robots_from_its_making_to_its_end(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(open_connections, "LIMITS", replace(LIMITS, credential_check_s=0.02))
    async with running_gateway(tmp_path, anonymous=False) as ready, client(ready, key=local_key(ready)) as admin:
        async with (
            ScriptedAgent(ready, "hall_1", session=b"h" * 16),
            ScriptedAgent(ready, "lab_1", session=b"l" * 16),
        ):
            asked = {"name": "wall display", "role": "operator", "robots": ["lab_*"]}
            made = (await admin.post("/api/v1/keys", json=asked)).json()
            async with client(ready, key=made["key"]) as http:
                seen = (await http.get("/api/v1/robots")).json()["robots"]
                assert [robot["id"] for robot in seen] == ["lab_1"]
                publish = {"topic": "/hall_1/x", "type": "std_msgs/String", "message": {"data": "x"}}
                hidden = await http.post("/api/v1/robots/hall_1/publish", json=publish)
                assert (hidden.status_code, hidden.json()["code"]) == (404, "unknown_robot")
                refused = await http.get("/api/v1/users")
                assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")
            async with open_socket(ready, "/api/v1/stream", key=made["key"]) as socket:
                await say(socket, op="subscribe_fleet", id=1)
                assert [robot["id"] for robot in (await hear(socket, "fleet"))["robots"]] == ["lab_1"]
                gone = await admin.request("DELETE", f"/api/v1/keys/{made['id']}", json={})
                assert gone.status_code == 200, gone.text
                async with asyncio.timeout(60):
                    await socket.wait_closed()
                assert (socket.close_code, socket.close_reason) == (4401, "bad_credentials")
            async with client(ready, key=made["key"]) as http:
                answer = await http.get("/api/v1/robots")
                assert (answer.status_code, answer.json()["code"]) == (401, "bad_credentials")


async def test_nobody_makes_a_key_that_may_more_than_its_maker(tmp_path: Path) -> None:
    ring = KeyRing()
    asked = {"name": "more", "role": "admin", "robots": ["*"]}
    async with running_gateway(tmp_path, authenticator=ring) as ready:
        for key in ("", ring.add(role=Role.VIEWER), ring.add(role=Role.OPERATOR, robots=("lab_*",))):
            async with client(ready, key=key) as http:
                assert (await http.post("/api/v1/keys", json=asked)).status_code in (400, 401, 403)
        narrow = ring.add(role=Role.OPERATOR, robots=("lab_*",))
        async with client(ready, key=narrow) as http:
            wider = await http.post("/api/v1/keys", json={**asked, "role": "operator"})
            assert wider.status_code in (400, 403), wider.text
