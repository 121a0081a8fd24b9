"""A day with twenty robots in two groups, all by REST: a camera's rate, a mistake, a node that keeps ending, and an
update that halts by itself and goes on with a fix.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx
import pytest

from gateway.domain.principal import Role
from gateway.fleet.updates import offline
from metaros.clock import SystemClock
from tests.gateway.fleet.updates.repositories import passphrase
from tests.gateway.harness import RING, client, running_gateway
from tests.support.deployment.bundles import make_bundle
from tests.support.robots.scripted_robot import MARK, Defects, StoryRobot

ADMIN = RING.add(role=Role.ADMIN, name="fleet admin")
OPERATOR = RING.add(role=Role.OPERATOR, name="fleet operator")
ROBOTS = [f"bot_{number:02}" for number in range(20)]
FIELD, YARD = ROBOTS[:10], ROBOTS[10:]
CAMERA = "camera/image/compressed"
WHEEL = "wheels/metaros-0-py3-none-any.whl"

pytestmark = pytest.mark.integration


async def until(condition: Callable[[], Awaitable[bool]]) -> None:
    """Ask again and again until it holds; by REST that takes an answer each time."""
    async with asyncio.timeout(240):
        while True:
            if await condition():
                return
            await asyncio.sleep(0.1)


async def good(answer: httpx.Response | Any) -> Any:
    """The JSON of an answer that went well."""
    answer = await answer
    assert answer.status_code < 300, answer.text
    return answer.json()


class Day:
    """The people's side."""

    def __init__(self, http: httpx.AsyncClient, folder: Path, robots: dict[str, StoryRobot], defects: Defects) -> None:
        self.http, self.folder, self.robots, self.defects = http, folder, robots, defects

    async def set_up(self) -> None:
        """Two groups by label, and the fleet's signatures."""
        for group, members in (("field", FIELD), ("yard", YARD)):
            for robot in members:
                await good(self.http.patch(f"/api/v1/robots/{robot}/labels", json={"labels": {"group": group}}))
        keys = (await good(self.http.post("/api/v1/updates/online-keys", json={})))["keys"]
        now_ns = SystemClock().wall_ns()
        await asyncio.to_thread(offline.init_root, self.folder, keys, passphrase, now_ns=now_ns)

    async def publish(self, version: str, *, defect: bool) -> None:
        """Sign and publish a version of the agent."""
        members = {WHEEL: version.encode(), **({MARK: b"on some robots"} if defect else {})}
        bundle = make_bundle(self.folder / "made", name="metaros", kind="agent", version=version, members=members)
        path = await asyncio.to_thread(offline.add, self.folder, bundle)
        now_ns = SystemClock().wall_ns()
        await asyncio.to_thread(offline.sign_role, self.folder, "targets", passphrase, now_ns=now_ns)
        content = await asyncio.to_thread((self.folder / "bundles" / path).read_bytes)
        kind = {"content-type": "application/zip"}
        await good(self.http.post("/api/v1/updates/bundles", content=content, headers=kind))
        found = await asyncio.to_thread(offline.release, self.folder)
        document = {"roots": [text.decode() for text in found.roots], "targets": found.targets.decode()}
        await good(self.http.post("/api/v1/updates/metadata", json=document))

    async def in_step(self) -> None:
        """Wait until every robot lives by its twin."""

        async def all_are() -> bool:
            twins = (await good(self.http.get("/api/v1/twins")))["twins"]
            return len(twins) == len(ROBOTS) and all(twin["in_step"] for twin in twins)

        await until(all_are)

    async def rollout(self, rid: str, *states: str) -> Any:
        """Wait until the rollout is in one of these states, and every robot at it has settled."""
        found: dict[str, Any] = {}

        async def there() -> bool:
            found.update(await good(self.http.get(f"/api/v1/rollouts/{rid}")))
            return found["state"] in states and not found["counts"]["updating"] and not found["counts"]["starting"]

        await until(there)
        return found


async def test_a_day_with_twenty_robots(tmp_path: Path) -> None:
    defects = Defects(looping={("bot_07", "lidar")})
    async with AsyncExitStack() as stack:
        ready = await stack.enter_async_context(running_gateway(tmp_path))
        robots = {
            name: await stack.enter_async_context(StoryRobot(ready, name, tmp_path / "robots" / name, defects))
            for name in ROBOTS
        }
        http = await stack.enter_async_context(client(ready, key=ADMIN))
        day = Day(http, tmp_path / "people", robots, defects)
        await day.set_up()
        await a_camera_rate_for_one_group(day)
        await a_mistake_that_never_leaves(day)
        await a_node_that_keeps_ending(day)
        await an_update_that_halts_and_is_mended(day)


async def a_camera_rate_for_one_group(day: Day) -> None:
    document = {"topics": {CAMERA: {"class": "live", "rate_hz": 5.0}}}
    template = {"selector": "group=field", "document": document}
    dry = await good(day.http.put("/api/v1/templates/camera?dry_run=true", json=template))
    assert sorted(item["robot"] for item in dry["results"]) == FIELD
    assert all(not robot.seen for robot in day.robots.values())
    await good(day.http.put("/api/v1/templates/camera", json=template))
    await day.in_step()
    for name, robot in day.robots.items():
        rate = robot.document.get("topics", {}).get(CAMERA, {}).get("rate_hz")
        assert rate == (5.0 if name in FIELD else None), name


async def a_mistake_that_never_leaves(day: Day) -> None:
    before = {name: (robot.revision, len(robot.seen)) for name, robot in day.robots.items()}
    wrong = {"selector": "group=yard", "document": {"parameters": {"/lidar": {"rate_hz": {"much": "too"}}}}}
    for answer in (
        await day.http.put("/api/v1/templates/lidar", json=wrong),
        await day.http.patch("/api/v1/twins", params={"selector": "group=yard"}, json=wrong["document"]),
    ):
        assert (answer.status_code, answer.json()["code"]) == (400, "twin_invalid"), answer.text
        assert "rate_hz" in answer.json()["detail"]
    await day.in_step()
    assert {name: (robot.revision, len(robot.seen)) for name, robot in day.robots.items()} == before


async def a_node_that_keeps_ending(day: Day) -> None:
    nodes = {"selector": "", "document": {"nodes": {"lidar": {"allowed": "lidar"}}}}
    await good(day.http.put("/api/v1/templates/nodes", json=nodes))
    await day.in_step()
    states = {}
    for name in ROBOTS:
        twin = await good(day.http.get(f"/api/v1/robots/{name}/twin"))
        states[name] = twin["reported"]["values"]["nodes"]["lidar"]["state"]
    assert {name for name, state in states.items() if state == "quarantined"} == {"bot_07"}
    assert {state for name, state in states.items() if name != "bot_07"} == {"running"}


async def an_update_that_halts_and_is_mended(day: Day) -> None:
    await day.publish("2.0.0", defect=True)
    order = {"version": "2.0.0", "selector": "group in (field, yard)", "waves": ["2", "10"], "steady_s": 0.0}
    order["max_failure_rate"] = 0.1
    dry = await good(day.http.post("/api/v1/rollouts", json={**order, "dry_run": True}))
    assert [wave["size"] for wave in dry["waves"]] == [2, 10, 8]
    rid = (await good(day.http.post("/api/v1/rollouts", json=order)))["id"]
    refused = await day.http.post("/api/v1/rollouts", json=order)
    assert (refused.status_code, refused.json()["code"]) == (409, "rollout_state")

    halted = await day.rollout(rid, "halted", "done")
    assert halted["state"] == "halted"
    assert len(day.defects.failed) == 2
    assert all(
        f"{robot} rolled_back: not healthy within its window" in halted["reason"] for robot in day.defects.failed
    )
    assert halted["counts"] == {"done": 10, "failed": 2, "waiting": 8, "starting": 0, "updating": 0, "unreached": 0}
    versions = [robot.version for robot in day.robots.values()]
    assert (versions.count("2.0.0"), versions.count("1.0.0")) == (10, 10)
    untouched = {item["robot"] for item in halted["members"] if item["state"] == "waiting"}
    assert all("agent" not in day.robots[name].document for name in untouched)

    early = await day.http.post(f"/api/v1/rollouts/{rid}/resume", json={"version": "2.0.1"})
    assert (early.status_code, early.json()["code"]) == (400, "invalid_request")  # nobody has published it
    await day.publish("2.0.1", defect=False)
    await good(day.http.post(f"/api/v1/rollouts/{rid}/resume", json={"version": "2.0.1"}))
    done = await day.rollout(rid, "done", "halted")
    assert (done["state"], done["counts"]["done"]) == ("done", 20), done
    assert {robot.version for robot in day.robots.values()} == {"2.0.1"}
    for robot in day.robots.values():
        assert robot.document["agent"] == {"version": "2.0.1"}
    history = await good(day.http.get(f"/api/v1/robots/{ROBOTS[0]}/twin/history"))
    assert history["entries"][0]["author"] == f"rollout {rid}"
    async with client_of_operator(day) as http:
        for verb in ("pause", "resume", "abort"):
            answer = await http.post(f"/api/v1/rollouts/{rid}/{verb}", json={})
            assert (answer.status_code, answer.json()["code"]) == (403, "forbidden")
        assert (await http.get(f"/api/v1/rollouts/{rid}")).json()["state"] == "done"


def client_of_operator(day: Day) -> httpx.AsyncClient:
    """Somebody who may look, and not steer."""
    headers = {"authorization": f"Bearer {OPERATOR}"}
    return httpx.AsyncClient(base_url=day.http.base_url, headers=headers, trust_env=False, timeout=60)
