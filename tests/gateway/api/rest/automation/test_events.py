"""Events over HTTP: pages, scopes, server-sent events that go on where they were, and an unmodified curl."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncGenerator, AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest

from gateway.api.models.events import EventList
from gateway.api.rest.sse import EventPieces, server_event
from gateway.domain.principal import Role
from gateway.errors import StoreError
from gateway.main import Ready
from tests.gateway.harness import OPERATOR_KEY, RING, ScriptedAgent, client, running_gateway

PATH = "/api/v1/events"


async def page(http: httpx.AsyncClient, count: int, **query: Any) -> EventList:
    """A page with so many events at least, as soon as there are; of all robots, unless `query` says more."""
    async with asyncio.timeout(60):
        while True:
            answer = await http.get(PATH, params=query)
            found = EventList.model_validate_json(answer.content)
            if len(found.events) >= count:
                return found
            await asyncio.sleep(0.02)


def short(found: EventList) -> list[tuple[str, str | None]]:
    """What happened to whom."""
    return [(event.type, event.subject) for event in found.events]


@asynccontextmanager
async def following(http: httpx.AsyncClient, **headers: str) -> AsyncIterator[AsyncIterator[dict[str, str]]]:
    """The fields of each block of a stream of events, comments left out."""

    async def blocks(answer: httpx.Response) -> AsyncIterator[dict[str, str]]:
        fields: dict[str, str] = {}
        async for line in answer.aiter_lines():
            name, _, value = line.partition(": ")
            if line == "" and fields:
                yield fields
                fields = {}
            elif name:
                fields[name] = value

    async with http.stream("GET", PATH, headers={"Accept": "text/event-stream", **headers}) as answer:
        assert answer.status_code == 200
        assert answer.headers["content-type"].startswith("text/event-stream")
        yield blocks(answer)


async def test_robots_that_come_and_go_are_events(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        for robot in ("r1", "r2"):
            async with ScriptedAgent(ready, robot):
                await page(http, 1, robot=robot)
        found = await page(http, 4, after=0)
        assert sorted(short(found)) == sorted(
            (f"metaros.robot.{kind}", robot) for robot in ("r1", "r2") for kind in ("online", "offline")
        )
        assert [int(event.id) for event in found.events] == [1, 2, 3, 4]
        assert found.events[0].data == {"hostname": "bench", "agent_version": "test"}
        assert found.next == "4"
        assert short(await page(http, 2, kind="metaros.robot.online", after=0)) == [
            ("metaros.robot.online", "r1"),
            ("metaros.robot.online", "r2"),
        ]
        newest = await page(http, 1, limit=1)
        older = await page(http, 3, before=newest.next or "", limit=9)
        assert [int(event.id) for event in (*newest.events, *older.events)] == [4, 3, 2, 1]
        assert older.next is None


async def test_who_sees_some_robots_hears_of_those_alone(tmp_path: Path) -> None:
    key = RING.add(role=Role.VIEWER, robots=("r1",), name="some robots")
    async with running_gateway(tmp_path) as ready, client(ready, key=key) as http, client(ready) as all_of_them:
        async with ScriptedAgent(ready, "r1"), ScriptedAgent(ready, "r2"):
            await page(all_of_them, 2)
            assert short(await page(http, 1)) == [("metaros.robot.online", "r1")]
            assert (await page(http, 0, robot="r2", after=0)).events == []
            async with following(http, **{"Last-Event-ID": "0"}) as events:
                await anext(events)  # where it begins
                assert json.loads((await anext(events))["data"])["subject"] == "r1"


async def test_a_stream_goes_on_where_it_was(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        async with following(http) as events:
            assert await anext(events) == {"retry": "2000", "id": "0"}
            async with ScriptedAgent(ready, "r1"):
                first = await anext(events)
        assert (first["id"], json.loads(first["data"])["type"]) == ("1", "metaros.robot.online")
        async with ScriptedAgent(ready, "r2"):
            await page(http, 3)
        async with following(http, **{"Last-Event-ID": first["id"]}) as events:
            assert (await anext(events))["id"] == "1"
            assert [(await anext(events))["id"] for _ in range(2)] == ["2", "3"]


async def test_curl_follows_the_events(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        curl = await asyncio.create_subprocess_exec(
            *("curl", "--silent", "--no-buffer", "--noproxy", "*", "--header", "Accept: text/event-stream"),
            *("--header", f"Authorization: Bearer {OPERATOR_KEY}", f"{ready.url}{PATH}?after=0&kind=robot.online"),
            stdout=asyncio.subprocess.PIPE,
        )
        try:
            assert curl.stdout is not None
            async with ScriptedAgent(ready, "r1"), asyncio.timeout(60):
                while not (line := await curl.stdout.readline()).startswith(b"data: "):
                    assert line
            assert json.loads(line.removeprefix(b"data: "))["type"] == "metaros.robot.online"
            assert (await page(http, 1, kind="robot.on*")).events
        finally:
            curl.kill()
            await curl.wait()


WRONG: tuple[tuple[str, dict[str, str]], ...] = (
    ("after=-1", {}),
    ("limit=0", {}),
    ("limit=1001", {}),
    ("robot=%00", {}),
    (f"robot={',r' * 70}", {}),
    ("", {"Accept": "text/event-stream", "Last-Event-ID": "yesterday"}),
    ("", {"Accept": "text/event-stream", "Last-Event-ID": "9" * 30}),
)


async def test_what_cannot_be_asked_is_said(ready_gateway: Ready) -> None:
    async with client(ready_gateway) as http:
        for query, headers in WRONG:
            answer = await http.get(f"{PATH}?{query}", headers=headers)
            assert (answer.status_code, answer.json()["code"]) == (400, "invalid_request"), (query, headers)


async def test_one_asker_has_so_many_streams(ready_gateway: Ready) -> None:
    async with client(ready_gateway) as http:
        streams = [http.stream("GET", PATH, headers={"Accept": "text/event-stream"}) for _ in range(64)]
        try:
            for opened in streams:
                assert (await opened.__aenter__()).status_code == 200
            refused = await http.get(PATH, headers={"Accept": "text/event-stream"})
            assert (refused.status_code, refused.json()["code"]) == (429, "too_many")
        finally:
            for opened in streams:
                await opened.__aexit__(None, None, None)
        async with asyncio.timeout(60):
            while True:
                async with http.stream("GET", PATH, headers={"Accept": "text/event-stream"}) as answer:
                    if answer.status_code == 200:
                        return


@pytest.fixture
async def ready_gateway(tmp_path: Path) -> AsyncIterator[Ready]:
    """A gateway."""
    async with running_gateway(tmp_path) as ready:
        yield ready


async def test_a_stream_says_that_it_lives_and_why_it_ends() -> None:
    going = asyncio.Event()

    async def items() -> AsyncGenerator[int, None]:
        await going.wait()
        yield 7
        raise StoreError("the store is away")

    left: list[str] = []
    stream = EventPieces(
        items(), lambda item: server_event(item, cursor="7"), closed=lambda: left.append("x"), beat_s=0
    )
    pieces = stream.pieces()
    assert await anext(pieces) == b"retry: 2000\n\n"
    assert await anext(pieces) == b":\n\n"
    going.set()
    rest = [piece async for piece in pieces if piece != b":\n\n"]
    assert rest[0] == b"id: 7\ndata: 7\n\n"
    assert rest[1].startswith(b'event: end\ndata: {"code":"store_unavailable"')
    stream.close()
    stream.close()
    assert left == ["x"]
