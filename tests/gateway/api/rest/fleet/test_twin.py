"""Twins and templates by REST: who may, what is answered, what is tried first, and what a robot is sent."""

from __future__ import annotations

import asyncio
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from gateway.api.views import twin as views_twin
from gateway.domain.principal import Role
from metaros._proto import link_pb2
from metaros.fleet.twin import digest
from metaros.limits import LIMITS
from tests.gateway.harness import CONTROL, RING, ScriptedAgent, client, running_gateway

ADMIN_KEY = RING.add(role=Role.ADMIN, name="test admin")
VIEWER_KEY = RING.add(role=Role.VIEWER, name="test viewer")
SCOPED_KEY = RING.add(role=Role.ADMIN, name="scoped admin", robots=("a*",))
LIDAR = {"nodes": {"lidar": {"bundle": "lidar-node", "version": "1.2.0"}}}


async def report(agent: ScriptedAgent, **said: Any) -> None:
    document = said.pop("document", {})
    await agent.send(CONTROL, twin=link_pb2.TwinReport(sha256=digest(document), **said))


async def test_a_robot_is_sent_what_is_desired_and_confirmed(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http, ScriptedAgent(ready) as agent:
        assert (await http.get("/api/v1/robots/sim_1/twin")).json()["reported"] is None
        await report(agent, state="applied", reported=b'{"agent":{"version":"1.0"}}')
        answer = await http.patch("/api/v1/robots/sim_1/twin?reason=first&confirm_within_s=30", json=LIDAR)
        assert answer.json()["changes"] == [{"path": "/nodes", "verb": "add", "new": LIDAR["nodes"]}]
        twin = (await agent.next("twin")).twin
        assert (twin.revision, twin.confirm_within_ms, twin.sha256) == (1, 30_000, digest(LIDAR))
        assert json.loads(twin.document) == LIDAR
        await report(agent, revision=1, applied=1, state="confirming", document=LIDAR)
        assert (await agent.next("twin_confirmed")).twin_confirmed.revision == 1
        await report(agent, revision=1, applied=1, state="applied", document=LIDAR, reported=b'{"agent":{}}')

        for _ in range(3000):  # the report travels by itself
            if (await http.get("/api/v1/robots/sim_1/twin")).json()["in_step"]:
                break
            await asyncio.sleep(0.01)
        shown = await http.get("/api/v1/robots/sim_1/twin")
        body = shown.json()
        assert shown.headers["etag"] == '"1.1"'
        assert (body["author"], body["reason"], body["desired"], body["behind"]) == ("test admin", "first", LIDAR, [])
        assert (body["reported"]["applied"], body["reported"]["values"]) == (1, {"agent": {}})
        (brief,) = (await http.get("/api/v1/twins", params={"selector": "robot=sim_1"})).json()["twins"]
        assert (brief["in_step"], brief["state"]) == (True, "applied")
        assert (await http.get("/api/v1/twins", params={"selector": "robot!=sim_1"})).json()["twins"] == []


async def test_edits_are_checked_tried_and_taken_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http, ScriptedAgent(ready):
        path = "/api/v1/robots/sim_1/twin"
        bad = await http.patch(path, json={"nodes": {"lidar": {"nise": 1}}})
        assert (bad.status_code, bad.json()["code"]) == (400, "twin_invalid")
        assert "did you mean 'nice'?" in bad.json()["detail"]
        twice = await http.put(path, content='{"budget":{},"budget":{}}', headers={"content-type": "application/json"})
        assert (twice.status_code, twice.json()["code"]) == (400, "twin_invalid")
        tried = (await http.put(path + "?dry_run=true", json=LIDAR)).json()
        assert (tried["dry_run"], tried["changed"], tried["revision"]) == (True, True, 1)
        assert (await http.get(path)).json()["revision"] == 0
        await http.put(path, json=LIDAR)
        late = await http.put(path, json={}, headers={"If-Match": '"0"'})
        assert (late.status_code, late.json()["code"]) == (412, "twin_changed")
        assert (await http.put(path, json={}, headers={"If-Match": "nonsense"})).status_code == 400
        assert (await http.put(path, json={}, headers={"If-Match": '"1.1"'})).json()["revision"] == 2
        entries = (await http.get(path + "/history")).json()["entries"]
        assert [item["revision"] for item in entries] == [2, 1]
        assert entries[0]["changes"] == [{"path": "/nodes", "verb": "remove", "old": LIDAR["nodes"]}]
        assert entries[1]["changes"] == [{"path": "/nodes", "verb": "add", "new": LIDAR["nodes"]}]
        assert (await http.get(path + "/history?limit=1")).json() == {"entries": entries[:1], "more": 0}
        monkeypatch.setattr(views_twin, "LIMITS", replace(LIMITS, twin_page_bytes=1))
        assert (await http.get(path + "/history")).json() == {"entries": entries[:1], "more": 1}
        assert (await http.post(path + "/revert", json={"revision": 1})).json()["revision"] == 3
        assert (await http.get(path)).json()["own"] == LIDAR
        gone = await http.post(path + "/revert", json={"revision": 99})
        assert (gone.status_code, gone.json()["code"]) == (404, "unknown_revision")
        assert (await http.post(path + "/retry", json={})).json()["revision"] == 4
        assert (await http.get("/api/v1/robots/nobody/twin")).json()["code"] == "unknown_robot"
        assert "nodes" in (await http.get("/api/v1/twin/schema")).json()["properties"]


async def test_what_runs_is_an_admins_and_templates_are_of_who_sees_all(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as operator, ScriptedAgent(ready):
        path = "/api/v1/robots/sim_1/twin"
        refused = await operator.patch(path, json=LIDAR)
        assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")
        assert (await operator.patch(path, json={"budget": {"bytes_per_s": 9000}})).status_code == 200
        template = {"selector": "robot=sim_1", "document": {"budget": {"bytes_per_s": 5000}}}
        assert (await operator.put("/api/v1/templates/t", json=template)).status_code == 403
        async with client(ready, key=VIEWER_KEY) as viewer, client(ready, key=SCOPED_KEY) as scoped:
            assert (await viewer.get(path)).status_code == 200
            assert (await viewer.patch(path, json={})).status_code == 403
            assert (await viewer.patch("/api/v1/twins?selector=", json={})).status_code == 403
            assert (await scoped.put("/api/v1/templates/t", json=template)).status_code == 403
            assert (await scoped.delete("/api/v1/templates/t")).status_code == 403
            assert (await scoped.post("/api/v1/templates/t/revert", json={"revision": 1})).status_code == 403
            assert (await scoped.get(path)).status_code == 404
            assert (await scoped.get("/api/v1/twins")).json()["twins"] == []
            reached = (await scoped.patch("/api/v1/twins?selector=", json={"budget": {"bytes_per_s": 1234}})).json()
            assert reached["robots"] == 0
        assert (await operator.get(path)).json()["own"] == {"budget": {"bytes_per_s": 9000}}


async def test_templates_labels_and_many_robots(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN_KEY) as http:
        async with ScriptedAgent(ready, "a1"), ScriptedAgent(ready, "a2"), ScriptedAgent(ready, "b1"):
            template = {"selector": "site=lab", "document": {"topics": {"camera": {"rate_hz": 5.0}}}, "priority": 2}
            made = (await http.put("/api/v1/templates/lab?dry_run=true", json=template)).json()
            assert (made["dry_run"], made["changed"]) == (True, 0)
            assert (await http.get("/api/v1/templates")).json()["templates"] == []
            etag = (await http.put("/api/v1/templates/lab", json=template)).headers["etag"]
            labelled = await http.patch("/api/v1/robots/a1/labels", json={"labels": {"site": "lab"}})
            assert labelled.json()["own_labels"] == {"site": "lab"}
            assert (await http.get("/api/v1/robots/a1")).json()["labels"] == {"site": "lab"}
            shown = (await http.get("/api/v1/robots/a1/twin")).json()
            assert (shown["desired"], shown["own"]) == (template["document"], {})
            assert shown["templates"][0].startswith("lab@")
            patch = {"budget": {"bytes_per_s": 7000}}
            where = {"selector": "robot in (a1, a2)", "dry_run": "true"}
            tried = (await http.patch("/api/v1/twins", params=where, json=patch)).json()
            assert [item["robot"] for item in tried["results"]] == ["a1", "a2"]
            assert (await http.get("/api/v1/robots/a2/twin")).json()["revision"] == 0
            done = (await http.patch("/api/v1/twins", params={"selector": "robot in (a1, a2)"}, json=patch)).json()
            assert (done["changed"], [item["revision"] for item in done["results"]]) == (2, [2, 1])
            for text in ("site=", "a=b,", "in (a)", "x" * 5000):
                assert (await http.get("/api/v1/twins", params={"selector": text})).status_code in (400, 422)
            late = await http.delete("/api/v1/templates/lab", headers={"If-Match": '"999"'})
            assert late.status_code == 412
            gone = await http.delete("/api/v1/templates/lab", headers={"If-Match": etag})
            assert [item["robot"] for item in gone.json()["results"]] == ["a1"]
            assert (await http.get("/api/v1/templates/lab")).json()["code"] == "unknown_template"
            entries = (await http.get("/api/v1/templates/lab/history")).json()["entries"]
            assert [item["removed"] for item in entries] == [True, False]
            assert [item["changes"][0]["verb"] for item in entries] == ["remove", "add"]
            assert (await http.get("/api/v1/templates/lab/history?limit=1")).json()["entries"] == entries[:1]
            back = await http.post("/api/v1/templates/lab/revert", json={"revision": entries[1]["revision"]})
            assert [item["robot"] for item in back.json()["results"]] == ["a1"]
            shown = (await http.get("/api/v1/templates/lab")).json()
            assert {key: shown[key] for key in template} == template
            never = await http.post("/api/v1/templates/lab/revert", json={"revision": 1 << 40})
            assert (never.status_code, never.json()["code"]) == (404, "unknown_revision")
            assert (await http.get("/api/v1/templates/never/history")).json()["code"] == "unknown_template"
            wrong = await http.put("/api/v1/templates/lab", json={**template, "document": {"budget": {"x": 1}}})
            assert (wrong.status_code, wrong.json()["code"]) == (400, "twin_invalid")
