"""The link's part of the API: the byte budget reaches the agent and its refusals the client; losses are listed."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path

import httpx

from gateway.api.models import common
from metaros._proto import link_pb2
from metaros.link import BACKFILL_BIT
from tests.gateway.harness import CONTROL, EPOCH, ScriptedAgent, channel, client, running_gateway

Http = httpx.AsyncClient
UPLINK = "/api/v1/robots/sim_1/uplink"


async def until(condition: Callable[[], Awaitable[bool]], *, timeout_s: float = 60.0) -> None:
    async with asyncio.timeout(timeout_s):
        while not await condition():  # noqa: ASYNC110 - what is waited for is behind HTTP
            await asyncio.sleep(0.02)


async def test_a_budget_goes_to_the_agent_and_shows_at_once(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        for asked, reported in ((125_000, 125_000), (64_000.0, 64_000), (None, 0)):
            asking = asyncio.create_task(http.put(UPLINK, json={"bytes_per_s": asked}))
            command = (await agent.next("command", CONTROL)).command
            assert command.set_uplink.bytes_per_s == reported
            await agent.answer(command)
            answer = await asking
            common.Uplink.model_validate_json(answer.content)
            assert (answer.status_code, answer.json()["bytes_per_s"]) == (200, asked)
            assert (await http.get(UPLINK)).json()["bytes_per_s"] == asked
            assert (await http.get("/api/v1/robots/sim_1")).json()["link"]["budget_bytes_per_s"] == asked


async def test_what_no_agent_is_reported_is_refused(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        answer = await http.put(UPLINK, json={"bytes_per_s": 5000})
        assert (answer.status_code, answer.json()["code"]) == (404, "unknown_robot")
        async with ScriptedAgent(ready) as agent:
            for body in (
                {},
                {"bytes_per_s": 0},
                {"bytes_per_s": 999},
                {"bytes_per_s": "5000"},
                {"bytes_per_s": True},
                {"bytes": 5000},
            ):
                answer = await http.put(UPLINK, json=body)
                assert (answer.status_code, answer.json()["code"]) == (400, "invalid_request"), body
            asking = asyncio.create_task(http.put(UPLINK, json={"bytes_per_s": 5000}))
            await agent.answer((await agent.next("command", CONTROL)).command, code="unsupported")
            answer = await asking
            assert (answer.status_code, answer.json()["code"]) == (501, "unsupported")
            assert (await http.get(UPLINK)).json()["bytes_per_s"] is None
        await until(lambda: _state(http, "offline"))
        answer = await http.put(UPLINK, json={"bytes_per_s": 5000})
        assert (answer.status_code, answer.json()["code"]) == (503, "robot_offline")


async def _state(http: Http, state: str) -> bool:
    answer = await http.get("/api/v1/robots/sim_1")
    return bool(answer.json()["state"] == state)


async def test_declared_losses_are_listed_newest_first(tmp_path: Path) -> None:
    series = [link_pb2.Series(series_id=1, name="battery.x", topic="/sim_1/battery", field="x")]
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/sim_1/chatter", "std_msgs/msg/String"), series=series)
        await agent.samples(1, 1, [b"x", b"y"])
        gap = link_pb2.Gap(stream_id=1, epoch=EPOCH, from_seq=3, to_seq=7, reason="disk_full", from_ns=10**18)
        await agent.send(gap=gap)
        await agent.settled({1: 7})
        await until(lambda: _gaps(http, 1))
        metric = link_pb2.Gap(stream_id=0, epoch=EPOCH, from_seq=1, to_seq=2, reason="thinned", from_ns=10**18)
        await agent.send(gap=metric)
        await until(lambda: _gaps(http, 2))
        answer = await http.get("/api/v1/robots/sim_1/gaps")
        common.GapList.model_validate_json(answer.content)
        first, second = answer.json()["gaps"]
        assert (first["class"], first["topic"], first["reason"], first["count"]) == ("metric", None, "thinned", 2)
        assert (second["class"], second["topic"], second["from"], second["to"]) == ("bulk", "/sim_1/chatter", 3, 7)
        assert (second["stream"] & BACKFILL_BIT, second["backfill"], second["lost_to"]) == (0, False, None)
        assert len((await http.get("/api/v1/robots/sim_1/gaps?limit=1")).json()["gaps"]) == 1
        assert (await http.get("/api/v1/robots/sim_1/gaps?limit=0")).status_code == 400
        assert (await http.get("/api/v1/robots/nobody/gaps")).status_code == 404


async def _gaps(http: Http, count: int) -> bool:
    answer = await http.get("/api/v1/robots/sim_1/gaps")
    return len(answer.json()["gaps"]) == count


async def test_the_agents_words_on_its_link_are_shown(tmp_path: Path) -> None:
    depth = link_pb2.ClassDepth(name="bulk", fresh_bytes=1, backfill_bytes=2, samples=3, lost=4, quota_bytes=5)
    reported = link_pb2.LinkStatistics(
        transport="websocket", gateway="gw:8081", reconnects=2, classes=[depth], clock_offset_ns=-1_500_000
    )
    async with running_gateway(tmp_path) as ready, client(ready) as http, ScriptedAgent(ready) as agent:
        await agent.send(CONTROL, statistics=link_pb2.TopicStatistics(link=reported))

        async def shown() -> bool:
            link = (await http.get("/api/v1/robots/sim_1")).json()["link"]
            return bool(link["transport"] == "websocket")

        await until(shown)
        link = (await http.get("/api/v1/robots/sim_1")).json()["link"]
        assert (link["gateway"], link["reconnects"], link["clock_offset_ms"]) == ("gw:8081", 2, -1.5)
        assert link["classes"][0]["backfill_bytes"] == 2
        assert (link["budget_bytes_per_s"], link["forks"]) == (None, 0)
