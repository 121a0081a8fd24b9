"""Update files over HTTP: published by an admin, fetched by a robot with the token that its link brought it."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import httpx

from gateway.domain.principal import Role
from gateway.fleet.updates import offline
from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from tests.gateway import test_robot_links
from tests.gateway.fleet.updates.repositories import passphrase
from tests.gateway.harness import CONTROL, RING, ScriptedAgent, client, running_gateway
from tests.gateway.identity.identity_rig import Held
from tests.support.deployment.bundles import make_bundle

ADMIN = RING.add(role=Role.ADMIN, name="updates admin")
PATH = "nodes/lidar-node/1.0.0.zip"
ZIP = {"content-type": "application/zip"}


def signed(folder: Path, online: dict[str, Any]) -> dict[str, Any]:
    """A folder with one version, as it is published."""
    now_ns = SystemClock().wall_ns()
    offline.init_root(folder, online, passphrase, now_ns=now_ns)
    offline.add(folder, make_bundle(folder / "made"))
    offline.sign_role(folder, "targets", passphrase, now_ns=now_ns)
    found = offline.release(folder)
    return {"roots": [text.decode() for text in found.roots], "targets": found.targets.decode()}


async def published(ready: Ready, folder: Path) -> bytes:
    """Set up and publish one version; the bundle's bytes."""
    async with client(ready, key=ADMIN) as http:
        keys = (await http.post("/api/v1/updates/online-keys", json={})).json()["keys"]
        document = await asyncio.to_thread(signed, folder, keys)
        bundle = await asyncio.to_thread((folder / "bundles" / PATH).read_bytes)
        answer = await http.post("/api/v1/updates/metadata", json=document)
        assert (answer.status_code, answer.json()["code"]) == (409, "update_refused")  # the bundle comes first
        answer = await http.post("/api/v1/updates/bundles", content=bundle, headers=ZIP)
        assert answer.status_code == 201, answer.text
        assert (answer.json()["path"], answer.json()["signed"]) == (PATH, False)
        answer = await http.post("/api/v1/updates/metadata", json=document)
        assert answer.json() == {"roles": {"root": 1, "targets": 1, "snapshot": 1, "timestamp": 1}}
    return bundle


def robots(ready: Ready, token: str) -> httpx.AsyncClient:
    """A robot's HTTP client."""
    return client(ready, key=token)


async def test_a_robot_fetches_with_its_token(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready, "sim_1") as agent:
        bundle = await published(ready, tmp_path / "people")
        token = agent.welcomes[CONTROL].fetch_token
        assert token.startswith("mrf_sim_1~")
        async with robots(ready, token) as http:
            timestamp = await http.get("/api/v1/updates/metadata/timestamp.json")
            assert timestamp.json()["signed"]["_type"] == "timestamp"
            targets = (await http.get("/api/v1/updates/metadata/1.targets.json")).json()["signed"]["targets"]
            digest = targets[PATH]["hashes"]["sha256"]
            url = f"/api/v1/updates/targets/nodes/lidar-node/{digest}.1.0.0.zip"
            assert (await http.get(url)).content == bundle
            part = await http.get(url, headers={"range": "bytes=10-"})
            assert (part.status_code, part.content) == (206, bundle[10:])
            assert part.headers["content-range"] == f"bytes 10-{len(bundle) - 1}/{len(bundle)}"
            past = await http.get(url, headers={"range": f"bytes={len(bundle)}-"})
            assert past.status_code == 416
            assert (await http.get("/api/v1/updates/metadata/2.root.json")).status_code == 404
            for path in ("/api/v1/updates", "/api/v1/robots", "/api/v1/self", f"/api/v1/updates/bundles/{PATH}"):
                assert (await http.get(path)).status_code in (403, 404), path
            assert (await http.post("/api/v1/updates/withdrawals", json={"path": PATH})).status_code == 403
        async with client(ready, key=ADMIN) as http:
            listed = (await http.get("/api/v1/updates")).json()
            assert [one["signed"] for one in listed["bundles"]] == [True]
            assert (await http.get(url)).status_code == 403  # people read of them, robots fetch them
            gone = await http.post("/api/v1/updates/withdrawals", json={"path": PATH, "reason": "burns motors"})
            assert gone.json()["reason"] == "burns motors"
        async with robots(ready, token) as http:
            answer = await http.get(url)
            assert (answer.status_code, answer.json()["code"]) == (410, "update_withdrawn")


async def test_a_token_is_good_for_its_robot_alone_and_not_for_ever(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready, "sim_1") as agent:
        token = agent.welcomes[CONTROL].fetch_token
        robot, ends, mac = token.removeprefix("mrf_").split("~")
        wrong = [
            f"mrf_sim_2~{ends}~{mac}",
            f"mrf_{robot}~{int(ends) + 1}~{mac}",
            f"mrf_{robot}~{ends}~{'0' * 64}",
            f"mrf_{robot}~{ends}~",
            f"mrf_{robot}~-1~{mac}",
            f"mrf_{robot}~{ends}",
            "mrf_",
            f"mrf_{robot}~{'9' * 400}~{mac}",
        ]
        for text in wrong:
            async with robots(ready, text) as http:
                answer = await http.get("/api/v1/updates/metadata/timestamp.json")
                assert (answer.status_code, answer.json()["code"]) == (401, "bad_credentials"), text
        async with robots(ready, token) as http:
            answer = await http.get("/api/v1/updates/metadata/timestamp.json")
            assert (answer.status_code, answer.json()["code"]) == (404, "unknown_update")


async def test_a_bundle_comes_as_a_zip_and_what_is_none_leaves_nothing(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        for kind in ("application/json", "text/plain", "application/x-www-form-urlencoded", ""):
            headers = {"content-type": kind} if kind else {}
            answer = await http.post("/api/v1/updates/bundles", content=b"{}", headers=headers)
            assert (answer.status_code, answer.json()["code"]) == (415, "unsupported_media_type"), kind
        assert (await http.post("/api/v1/keys", content=b"{}", headers=ZIP)).status_code == 415
        answer = await http.post("/api/v1/updates/bundles", content=b"PK" * 1000, headers=ZIP)
        assert (answer.status_code, answer.json()["code"]) == (400, "bundle_invalid")
        assert list((tmp_path / "data" / "updates").iterdir()) == []


async def test_a_token_ends_with_the_identity_that_it_was_made_for(tmp_path: Path) -> None:
    async def fetches(ready: Ready, token: str) -> bool:
        async with robots(ready, token) as http:
            answer = await http.get("/api/v1/updates/metadata/timestamp.json")
        assert answer.status_code in (401, 404), answer.text  # nothing was published
        return answer.status_code == 404

    async def given(ready: Ready, held: Held, number: int) -> str:
        """What the Welcome of that identity brings."""
        hello = held.hello()
        hello.session_number = number
        async with test_robot_links.lane(ready, "grpc") as opened:
            await opened.send(hello=hello)
            frame = await asyncio.wait_for(opened.next(), 60)
            await opened.send(proof=link_pb2.Proof(signature=held.prove(hello, frame.challenge)))
            return (await asyncio.wait_for(opened.next(), 60)).welcome.fetch_token

    async with running_gateway(tmp_path, authenticator=test_robot_links.RING) as ready:
        first, _ = await test_robot_links.enrolled(ready)
        token = await given(ready, first, 1)
        assert await fetches(ready, token)
        await test_robot_links.revoke(ready, "arm")
        assert not await fetches(ready, token)
        again, _ = await test_robot_links.enrolled(ready, bound=True)
        fresh = await given(ready, again, 2)
        assert await fetches(ready, fresh)
        assert not await fetches(ready, token), "whoever took it then has nothing now"
