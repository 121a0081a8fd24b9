"""Queue, rules and functions as a gateway puts them together: what robots send sets functions off."""

from __future__ import annotations

import asyncio
import base64
import json
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx

from gateway.domain.automation.invocation import InvocationFilter, Recorded
from gateway.domain.robot import Robot
from gateway.ingest.registry import RobotRecord
from gateway.settings import Settings
from gateway.wiring.gateway import Gateway
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import SystemClock
from metaros.fleet.twin import digest
from metaros.interfaces.std_msgs.msg import String
from tests.gateway.api.rest.automation.test_functions import ADMIN, until
from tests.gateway.harness import CONTROL, ScriptedAgent, client, running_gateway
from tests.gateway.store.samples import run_write
from tests.support.gateways.lambda_gateway import ROLE, zipped


@asynccontextmanager
async def gateway(folder: Path) -> AsyncIterator[Gateway]:
    """One without ports, with a function `f`."""
    made = Gateway(Settings(data_dir=folder), clock=SystemClock())
    await made.start()
    running = asyncio.create_task(made.run())
    try:
        code = {"ZipFile": zipped()}
        options = {"Runtime": "python3.11", "Handler": "app.handler", "Role": ROLE}
        await made.automation.functions.catalogue.do("CreateFunction", {"FunctionName": "f", "Code": code, **options})
        yield made
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await made.stop()


async def calls(made: Gateway, count: int, kind: str) -> list[Recorded]:
    """The calls of a kind, once there are so many."""
    found: list[Recorded] = []

    async def there() -> bool:
        found[:] = await made.automation.functions.ledger.page(InvocationFilter(function="f", kind=kind), limit=99)
        return len(found) >= count

    await until(there)
    return found


async def test_messages_of_robots_call_a_function_by_a_mapping(tmp_path: Path) -> None:
    async with gateway(tmp_path) as made:
        functions = made.automation.functions
        asked = {"EventSourceArn": "arn:aws:metaros:::topic/r*/events", "FunctionName": "f", "BatchSize": 10}
        mapping = await functions.catalogue.do("CreateEventSourceMapping", asked)
        await until(lambda: asyncio.sleep(0, bool(functions.mappings._sources)))
        made.registry.add(RobotRecord(Robot("r1", "/", "host", "1", {}), seen_ns=1))
        payloads = [bytes(codec(String).encode(String(data=str(number)))) for number in range(5)]
        made.store.submit(run_write(1, payloads))
        (call,) = await calls(made, 1, "mapping")
        assert (call.robot, call.status) == ("r1", "ok")
        shown = await functions.catalogue.do("GetEventSourceMapping", {"UUID": mapping["UUID"]})
        assert shown["LastProcessingResult"] == "OK"
        assert functions.mappings.iterator_age_s("f") == 0.0


async def test_an_event_of_the_journal_calls_a_function_by_a_rule(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        code = base64.b64encode(zipped()).decode()
        await http.put("/api/v1/functions/f", json={"zip": code, "handler": "app.handler"})
        document: dict[str, Any] = {
            "name": "sold",
            "pattern": {"detail-type": ["shop.sold"]},
            "targets": [{"id": "call", "kind": "function", "function": "f"}],
        }
        put = await http.put("/api/v1/rules/sold", json=document)
        assert put.status_code == 201, put.text
        triggers = (await http.get("/api/v1/functions/f")).json()["triggers"]
        assert [(item["kind"], item["id"]) for item in triggers] == [("rule", "sold")]
        entries = [{"id": "s-1", "type": "shop.sold", "source": "shop", "detail": {"n": 1}}]
        for _ in range(2):  # the same one twice: it is one
            assert (await http.post("/api/v1/happenings", json={"entries": entries})).status_code == 202
        await called(http)


KINDS = (
    "robot.online",
    "robot.offline",
    "node.state",
    "node.crashed",
    "twin.applied",
    "twin.drifted",
    "twin.in_step",
)


async def test_what_happens_to_a_robot_reaches_the_rules(tmp_path: Path) -> None:
    """Each kind from the feature that sees it, by way of a link, to a rule of its own."""
    document = {"nodes": {"lidar": {"bundle": "lidar-node", "version": "1.2.0"}}}

    def nodes(**row: Any) -> bytes:
        return json.dumps({"nodes": {"lidar": {"version": "1.2.0", **row}}}).encode()

    async with running_gateway(tmp_path) as ready, client(ready, key=ADMIN) as http:
        for kind in KINDS:
            rule = {"name": kind, "pattern": {"detail-type": [f"metaros.{kind}"], "detail": {"robot": ["sim_1"]}}}
            put = await http.put(f"/api/v1/rules/{kind}", json={**rule, "targets": []})
            assert put.status_code == 201, put.text
        async with ScriptedAgent(ready) as agent:
            await agent.send(CONTROL, twin=link_pb2.TwinReport(state="applied", reported=b"{}"))
            edited = await http.put("/api/v1/robots/sim_1/twin", json=document)
            assert edited.status_code == 200, edited.text
            revision = (await agent.next("twin")).twin.revision
            said = {"revision": revision, "applied": revision, "state": "applied", "sha256": digest(document)}
            good, bad = nodes(state="running", crashes=0), nodes(state="waiting", crashes=1, last_exit="signal 9")
            for reported in (good, bad, good):
                await agent.send(CONTROL, twin=link_pb2.TwinReport(**said, reported=reported))
            await until(lambda: fired(http, "twin.in_step"))  # a link that ends takes along what was not read yet
        for kind in KINDS:
            await until(lambda kind=kind: fired(http, kind))  # type: ignore[misc]


async def fired(http: httpx.AsyncClient, rule: str) -> bool:
    """Whether a rule has."""
    return bool((await http.get(f"/api/v1/rules/{rule}")).json()["stats"]["fired"])


async def called(http: httpx.AsyncClient) -> None:
    """Wait for one call by an event, and see that it stays one."""

    async def there() -> bool:
        stats = (await http.get("/api/v1/functions/f")).json()["stats"]
        return bool(stats["invocations"] == 1 and not stats["waiting"])

    await until(there)
