"""Groups, snapshots, and edits under a condition."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx

from gateway.api.models.fleet import GroupList, Snapshot
from gateway.domain.principal import Role
from metaros._proto import link_pb2
from metaros.cdr import codec
from tests.gateway.harness import RING, ScriptedAgent, channel, client, running_gateway

ROBOTS = "/api/v1/robots"
STRING = "std_msgs/msg/String"
BULK, LIVE = link_pb2.DELIVERY_CLASS_BULK, link_pb2.DELIVERY_CLASS_LIVE


def text(value: str) -> bytes:
    """A string message as CDR."""
    return codec(STRING).encode(SimpleNamespace(data=value))


async def until(http: httpx.AsyncClient, path: str, condition: Callable[[Any], bool]) -> None:
    """Wait until the answer at a path is so."""
    async with asyncio.timeout(60):
        while True:
            if condition((await http.get(path)).json()):
                return
            await asyncio.sleep(0.02)


async def announced(http: httpx.AsyncClient, count: int) -> None:
    """Wait until the gateway knows so many topics of r1."""
    await until(http, f"{ROBOTS}/r1/topics", lambda found: len(found["topics"]) == count)


async def test_a_snapshot_is_what_comes_and_else_what_is_stored(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready, "r1") as agent:
        series = [link_pb2.Series(series_id=1, name="battery.x", topic="/r1/battery", field="x")]
        await agent.announce(
            channel(1, "/r1/chatter", STRING, delivery=LIVE),
            channel(2, "/r1/diary", STRING, delivery=BULK),
            channel(3, "/r1/silent", STRING, delivery=BULK),
            channel(4, "/r1/broken", STRING, delivery=LIVE),
            series=series,
        )
        await agent.rows(1, [(1, 5, 1.5)])
        await agent.samples(2, 1, [text("first"), text("second")])
        await agent.settled({0: 1, 2: 2})
        await announced(http, 4)
        looking = asyncio.create_task(http.get(f"{ROBOTS}/r1/snapshot", params={"wait_s": 10}))
        demand = (await agent.next("demand")).demand  # the look makes the robot send what it sends to nobody else
        assert {entry.channel_id for entry in demand.entries} == {1, 4}
        await agent.samples(1, 1, [text("old"), text("new")])
        await agent.samples(4, 1, [b"\0"])
        answer = await looking
        found = Snapshot.model_validate_json(answer.content)
        shown = {item.topic: (item.source, item.message and item.message["data"]) for item in found.topics}
        assert shown == {
            "/r1/chatter": ("live", "new"),
            "/r1/diary": ("stored", "second"),
            "/r1/broken": ("live", None),
        }
        errors = {item.topic: item.error.code for item in found.topics if item.error is not None}
        assert errors == {"/r1/broken": "malformed_cdr"}
        assert found.missing == ["/r1/silent"]
        assert (found.robot, found.online, found.metrics["battery.x"].value) == ("r1", True, 1.5)
        stored = (await http.get(f"{ROBOTS}/r1/snapshot", params={"wait_s": 0, "topic": "diary"})).json()
        assert [item["topic"] for item in stored["topics"]] == ["/r1/diary"]  # a relative name is the robot's
        assert stored["missing"] == []
        assert (await http.get(f"{ROBOTS}/r2/snapshot")).json()["code"] == "unknown_robot"


async def test_a_snapshot_of_a_robot_that_is_away_does_not_wait(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        async with ScriptedAgent(ready, "r1") as agent:
            await agent.announce(channel(1, "/r1/chatter", STRING, delivery=LIVE))
            await announced(http, 1)
        await until(http, f"{ROBOTS}/r1", lambda found: found["state"] == "offline")
        found = (await http.get(f"{ROBOTS}/r1/snapshot", params={"wait_s": 10})).json()
        assert (found["online"], found["topics"], found["missing"]) == (False, [], ["/r1/chatter"])


async def test_groups_are_the_values_of_labels(tmp_path: Path) -> None:
    some = RING.add(role=Role.VIEWER, robots=("r1",), name="one robot")
    async with (
        running_gateway(tmp_path) as ready,
        client(ready) as http,
        client(ready, key=some) as narrow,
        ScriptedAgent(ready, "r1"),
        ScriptedAgent(ready, "r2"),
    ):
        await until(http, "/api/v1/twins", lambda found: len(found["twins"]) == 2)  # they are stored by now
        tried = await http.patch("/api/v1/groups?selector=&dry_run=true", json={"labels": {"site": "x"}})
        assert (tried.status_code, tried.json()["changed"]) == (200, 2), tried.text
        assert (await http.get("/api/v1/groups")).json() == {"groups": [], "next": None}
        await http.patch("/api/v1/groups?selector=", json={"labels": {"site": "berlin", "kind": "amr"}})
        await http.patch(f"{ROBOTS}/r2/labels", json={"labels": {"site": "paris"}})

        async def groups(asker: httpx.AsyncClient, **query: Any) -> dict[str, tuple[int, int]]:
            found = GroupList.model_validate_json((await asker.get("/api/v1/groups", params=query)).content)
            return {item.selector: (item.robots, item.online) for item in found.groups}

        assert await groups(http) == {"kind=amr": (2, 2), "site=berlin": (1, 1), "site=paris": (1, 1)}
        assert await groups(http, label="site") == {"site=berlin": (1, 1), "site=paris": (1, 1)}
        assert await groups(narrow) == {"kind=amr": (1, 1), "site=berlin": (1, 1)}
        first = (await http.get("/api/v1/groups", params={"limit": 1})).json()
        rest = (await http.get("/api/v1/groups", params={"limit": 9, "after": first["next"]})).json()
        assert [item["value"] for item in (*first["groups"], *rest["groups"])] == ["amr", "berlin", "paris"]
        refused = await http.patch("/api/v1/groups?selector=", json={"labels": {"no good": "x"}})
        assert (refused.status_code, refused.json()["code"]) == (400, "selector_invalid")


async def test_a_user_is_edited_only_as_it_was_read(tmp_path: Path) -> None:
    key = RING.add(role=Role.ADMIN, name="editor")
    async with running_gateway(tmp_path) as ready, client(ready, key=key) as http:
        made = await http.post("/api/v1/users", json={"name": "ada", "role": "viewer"})
        assert made.status_code == 201, made.text
        read = await http.get("/api/v1/users/ada")
        old = {"If-Match": read.headers["etag"]}
        changed = await http.patch("/api/v1/users/ada", json={"role": "operator"}, headers=old)
        assert (changed.status_code, changed.json()["role"]) == (200, "operator")
        for late in (
            await http.patch("/api/v1/users/ada", json={"role": "viewer"}, headers=old),
            await http.delete("/api/v1/users/ada", headers=old),
        ):
            assert (late.status_code, late.json()["code"]) == (412, "changed")
        assert (await http.get("/api/v1/users/ada")).json()["role"] == "operator"
        new = {"If-Match": (await http.get("/api/v1/users/ada")).headers["etag"]}
        assert (await http.delete("/api/v1/users/ada", headers=new)).status_code == 200
        assert (await http.get("/api/v1/users/ada")).json()["code"] == "unknown_user"


async def test_a_byte_budget_is_set_only_as_it_was_read(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready, "r1") as agent:
        path = f"{ROBOTS}/r1/uplink"
        tag = (await http.get(path)).headers["etag"]
        setting = asyncio.create_task(http.put(path, json={"bytes_per_s": 5000}, headers={"If-Match": tag}))
        await agent.answer((await agent.next("command")).command)
        done = await setting
        assert (done.status_code, done.json()["bytes_per_s"]) == (200, 5000)
        late = await http.put(path, json={"bytes_per_s": 6000}, headers={"If-Match": tag})
        assert (late.status_code, late.json()["code"]) == (412, "changed")
        assert done.headers["etag"] != tag
