"""The history API over HTTP: answers that fit their models, bad questions, and exports whose readers go."""

from __future__ import annotations

import asyncio
import io
import json
import os
import socket
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from mcap.reader import make_reader

from gateway.api.models import history as models_history
from gateway.api.rest import downloads
from gateway.api.rest.history.history import RECORDS_TYPE
from gateway.api.rest.ranges import chosen_topics, full_pattern, parse_age
from gateway.domain.records import split_records
from gateway.errors import InvalidRequestError
from gateway.history import manager
from gateway.main import Ready
from gateway.store.engines import open_engine
from gateway.store.ledger import in_transaction
from gateway.store.objects import open_objects
from gateway.store.telemetry.compact import Compaction, CompactPace
from metaros._proto import link_pb2
from metaros.cdr import codec
from metaros.clock import SystemClock
from metaros.interfaces.std_msgs.msg import String
from metaros.limits import LIMITS, Limits
from tests.gateway.harness import EPOCH, OPERATOR_KEY, ScriptedAgent, bearer, channel, client, running_gateway
from tests.support.gateways.plain_http import TRUSTS_NOBODY

shared = pytest.mark.asyncio(loop_scope="module")
BASE = "/api/v1/robots/sim_1"
RANGE = "start=2001-09-09T01:46:40Z&end=2001-09-09T01:46:50Z"
START_NS = 10**18


async def fill(agent: ScriptedAgent) -> None:
    """Two topics with ten messages each, a loss of five, and rows."""
    series = [link_pb2.Series(series_id=1, name="battery.x", topic="/sim_1/battery", field="x")]
    topics = ("/sim_1/chatter", "/sim_1/lidar/scan")
    await agent.announce(
        *(channel(number, topic, "std_msgs/msg/String") for number, topic in enumerate(topics, 1)), series=series
    )
    encode = codec(String).encode
    await agent.rows(1, [(1, START_NS + 5 * 10**9, 1.0), (1, START_NS + 6 * 10**9, float("nan"))])
    for number in (1, 2):
        payloads = [encode(String(data=f"{number}.{n}")) for n in range(10)]
        await agent.samples(number, 1, payloads, stamp_ns=START_NS + number)
    gap = link_pb2.Gap(
        stream_id=1, epoch=EPOCH, from_seq=11, to_seq=15, reason="outbox_full", from_ns=START_NS, to_ns=START_NS + 9
    )
    await agent.send(gap=gap)
    await agent.settled({0: 2, 1: 15, 2: 10})


@dataclass(frozen=True)
class World:
    """A gateway that has what `fill` sends of sim_1, `make_noise` of noisy, and of fresh nothing."""

    ready: Ready
    http: httpx.AsyncClient


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def world(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[World]:
    async with running_gateway(tmp_path_factory.mktemp("gateway")) as ready, client(ready) as http:
        async with ScriptedAgent(ready) as agent:
            await fill(agent)
        async with ScriptedAgent(ready, "noisy", session=b"n" * 16) as noisy:
            await make_noise(noisy)
        async with ScriptedAgent(ready, "fresh", session=b"f" * 16):
            pass
        yield World(ready, http)


def slow_reader(ready: Ready) -> httpx.AsyncClient:
    """A client whose system takes little that it does not read."""
    small = [(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 16)]
    transport = httpx.AsyncHTTPTransport(verify=TRUSTS_NOBODY, trust_env=False, socket_options=small)
    return httpx.AsyncClient(base_url=ready.url, headers=bearer(OPERATOR_KEY), transport=transport, timeout=60)


async def get(http: httpx.AsyncClient, path: str) -> dict[str, Any]:
    answer = await http.get(path)
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


@shared
async def test_answers_fit_their_models(world: World) -> None:
    http = world.http
    for path, model in [
        (f"{BASE}/history", models_history.History),
        (f"{BASE}/timeline?{RANGE}&buckets=7", models_history.Timeline),
        (f"{BASE}/messages?{RANGE}", models_history.MessagePage),
        (f"{BASE}/messages?{RANGE}&format=cdr&order=desc&limit=3", models_history.MessagePage),
        (f"{BASE}/at?t=2001-09-09T01:46:41Z&topic=chatter&topic=none&format=json", models_history.InstantMessages),
    ]:
        model.model_validate_json((await http.get(path)).content)


@shared
async def test_what_is_stored(world: World) -> None:
    http = world.http
    assert await get(http, "/api/v1/robots/fresh/history") == {"topics": [], "series": 0, "first": None, "last": None}
    history = await get(http, f"{BASE}/history")
    assert [(row["topic"], row["samples"], row["class"]) for row in history["topics"]] == [
        ("/sim_1/chatter", 10, "bulk"),
        ("/sim_1/lidar/scan", 10, "bulk"),
    ]
    assert (history["series"], history["first"]) == (1, "2001-09-09T01:46:40.000Z")
    line = await get(http, f"{BASE}/timeline?{RANGE}&buckets=10")
    assert line["messages"] == [20, *[0] * 9]
    assert line["rows"] == [0, 0, 0, 0, 0, 1, 1, 0, 0, 0]
    assert line["width_ms"] == 1000
    (gap,) = line["gaps"]
    assert (gap["count"], gap["reason"], gap["topic"]) == (5, "outbox_full", "/sim_1/chatter")


@shared
async def test_messages_page_by_page_with_their_losses(world: World) -> None:
    http = world.http
    shown, cursor = [], ""
    for _ in range(9):
        page = await get(http, f"{BASE}/messages?{RANGE}&topic=chatter&limit=4{cursor}")
        shown += [message["message"]["data"] for message in page["messages"]]
        assert [gap["count"] for gap in page["gaps"]] == [5]
        if page["next"] is None:
            break
        cursor = f"&cursor={page['next']}"
    assert shown == [f"1.{n}" for n in range(10)]
    other = await get(http, f"{BASE}/messages?{RANGE}&topic=lidar/**&order=desc&limit=1")
    assert (other["messages"][0]["message"], other["gaps"]) == ({"data": "2.9"}, [])


@shared
async def test_an_instant_as_records_and_as_json(world: World) -> None:
    http = world.http
    path = f"{BASE}/at?t=2001-09-09T01:46:41Z&topic=chatter&topic=**/scan&topic=none"
    answer = await http.get(path)
    assert answer.headers["content-type"] == RECORDS_TYPE
    length = int.from_bytes(answer.content[:4], "little")
    facts = json.loads(answer.content[4 : 4 + length])
    records = list(split_records(answer.content[4 + length :]))
    assert [(row["channel"], row["topic"]) for row in facts["channels"]] == [
        (1, "/sim_1/chatter"),
        (2, "/sim_1/lidar/scan"),
    ]
    assert [(number, record.seq) for _, number, record in records] == [(1, 10), (2, 10)]
    assert facts["missing"] == [{"topic": "/sim_1/none", "reason": "not_stored", "nearest_ms": None}]
    assert [gap["count"] for gap in facts["gaps"]] == [5]
    decoded = await get(http, f"{path}&format=json")
    assert [message["message"]["data"] for message in decoded["messages"]] == ["1.9", "2.9"]
    late = await get(http, f"{BASE}/at?t=2001-09-09T02:00:00Z&topic=chatter&format=json&max_age=1m")
    assert [item["reason"] for item in late["missing"]] == ["too_old"]


BAD: list[tuple[str, int, str]] = [
    ("/api/v1/robots/nobody/history", 404, "nobody"),
    ("/api/v1/robots/nobody/at?t=now", 404, "nobody"),
    (f"{BASE}/timeline?start=now&end=-1h", 400, "end"),
    (f"{BASE}/timeline?buckets=0", 400, "buckets"),
    (f"{BASE}/messages?limit=1001", 400, "limit"),
    (f"{BASE}/messages?format=xml", 400, "format"),
    (f"{BASE}/messages?cursor=AAAA", 400, "cursor"),
    (f"{BASE}/messages?topic={'a' * 300}", 400, "topic"),
    (f"{BASE}/messages?{'&'.join(['topic=a'] * 65)}", 400, "topic"),
    (f"{BASE}/at", 400, "t"),
    (f"{BASE}/at?t=now&max_age=long", 400, "max_age"),
    (f"{BASE}/at?t=now&max_age=31d", 400, "max_age"),
    ("/api/v1/export.mcap", 400, "robot"),
    ("/api/v1/export.mcap?robot=sim_1&robot=nobody", 404, "nobody"),
    ("/api/v1/export.mcap?robot=sim_1&start=now&end=-1h", 400, "end"),
]


@shared
async def test_bad_questions_say_what(world: World) -> None:
    http = world.http
    for path, status, what in BAD:
        answer = await http.get(path)
        assert (answer.status_code, answer.headers["content-type"]) == (status, "application/problem+json"), path
        assert what in answer.json()["detail"], path


@shared
async def test_too_many_questions_are_refused(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    """With a limit of one, all other requests are refused, and the one that is served is served."""
    http = world.http
    monkeypatch.setattr(manager, "WAITING", 1)
    answers = await asyncio.gather(*(http.get(f"{BASE}/messages?{RANGE}") for _ in range(8)))
    codes = [answer.status_code for answer in answers]
    assert set(codes) <= {200, 429}
    assert 200 in codes
    assert {answer.json()["code"] for answer in answers if answer.status_code == 429} <= {"too_many"}
    monkeypatch.setattr(manager, "WAITING", 0)
    refused = await http.get(f"{BASE}/messages?{RANGE}")
    assert (refused.status_code, refused.json()["code"]) == (429, "too_many")


@shared
async def test_an_export_over_http(world: World) -> None:
    http = world.http
    answer = await http.get(f"/api/v1/export.mcap?robot=sim_1&topic=chatter&{RANGE}")
    assert answer.headers["content-disposition"] == 'attachment; filename="sim_1-20010909T014640Z.mcap"'
    reader = make_reader(io.BytesIO(answer.content), validate_crcs=True)
    assert [message.log_time - START_NS - 1 for _, _, message in reader.iter_messages()] == list(range(10))
    (record,) = reader.iter_metadata()
    assert [loss["count"] for loss in json.loads(record.metadata["/sim_1/chatter sim_1"])["losses"]] == [5]


NOISE_MIB = 16  # more than the systems between the two of them take before it is read
EXPORT = f"/api/v1/export.mcap?robot=noisy&{RANGE}"


async def make_noise(agent: ScriptedAgent) -> None:
    """That no compression makes smaller."""
    await agent.announce(channel(1, f"/{agent.robot}/noise", "std_msgs/msg/String"))
    for number in range(1, NOISE_MIB + 1):
        await agent.samples(1, number, [os.urandom(1 << 20)], stamp_ns=START_NS)
    await agent.settled({1: NOISE_MIB})


@shared
async def test_readers_that_go_give_their_place_back(world: World) -> None:
    """Large exports whose readers read nothing hold all the places; when they go, the next one is served."""
    http = world.http
    async with slow_reader(world.ready) as slow:
        async with AsyncExitStack() as readers:
            for _ in range(LIMITS.exports):
                answer = await readers.enter_async_context(slow.stream("GET", EXPORT))
                assert answer.status_code == 200
            busy = await http.get(EXPORT)
            assert (busy.status_code, busy.json()["code"]) == (429, "too_many")
        async with asyncio.timeout(60):
            while (answer := await http.get(EXPORT)).status_code == 429:
                pass
    assert answer.status_code == 200
    assert len(list(make_reader(io.BytesIO(answer.content)).iter_messages())) == NOISE_MIB


@shared
async def test_a_reader_that_takes_nothing_gives_its_place_back(world: World, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(manager, "LIMITS", Limits(exports=1))
    monkeypatch.setattr(downloads, "STALL_S", 0.1)
    async with slow_reader(world.ready) as slow, slow.stream("GET", EXPORT) as answer, asyncio.timeout(60):
        assert answer.status_code == 200
        while (await world.http.get(f"{EXPORT}&topic=none")).status_code == 429:
            pass


async def test_a_gateway_that_stops_leaves_no_shorter_file(tmp_path: Path) -> None:
    """The connection of an export under way breaks; it does not end as if all was said."""
    async with AsyncExitStack() as after:
        async with running_gateway(tmp_path, drain_s=0.1) as ready, ScriptedAgent(ready, "noisy") as agent:
            await make_noise(agent)
            http = await after.enter_async_context(slow_reader(ready))
            pieces = (await after.enter_async_context(http.stream("GET", EXPORT))).aiter_bytes(1 << 16)
            assert (await anext(pieces)).startswith(b"\x89MCAP0")
        with pytest.raises(httpx.RemoteProtocolError):
            async for _ in pieces:
                pass


async def test_damage_is_named_and_the_rest_is_served(tmp_path: Path) -> None:
    """Of three segments one is gone and one has other bytes."""
    async with running_gateway(tmp_path) as ready, ScriptedAgent(ready) as agent:
        await agent.announce(channel(1, "/sim_1/chatter", "std_msgs/msg/String"))
        payload = codec(String).encode(String(data="x" * 100))
        for number in range(3):
            await agent.samples(1, 1 + 10 * number, [payload] * 10, stamp_ns=START_NS + number * 10**9)
            await agent.settled({1: 10 + 10 * number})
    await asyncio.to_thread(damage, tmp_path / "data")
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        answer = await http.get(f"/api/v1/export.mcap?robot=sim_1&{RANGE}")
        reader = make_reader(io.BytesIO(answer.content), validate_crcs=True)
        assert [message.log_time - START_NS for _, _, message in reader.iter_messages()] == list(range(10))
        (record,) = reader.iter_metadata()
        (loss,) = json.loads(record.metadata["/sim_1/chatter sim_1"])["losses"]
        assert (loss["count"], loss["reason"], loss["from_ms"]) == (20, "damaged", (START_NS + 10**9) / 1e6)
        page = await get(http, f"{BASE}/messages?{RANGE}")
        assert (len(page["messages"]), [gap["count"] for gap in page["gaps"]]) == (10, [20])
        at = await get(http, f"{BASE}/at?t=2001-09-09T01:46:50Z&topic=chatter&format=json")
        assert at["missing"] == [{"topic": "/sim_1/chatter", "reason": "damaged", "nearest_ms": None}]


def damage(data_dir: Path) -> None:
    """Make three segments of what is there, delete the second and change the third."""
    engine, _ = open_engine("", data_dir)
    pace = CompactPace(size_bytes=1)
    work = Compaction(engine, in_transaction(engine), open_objects("", data_dir), clock=SystemClock(), pace=pace)
    while any(work.compact(due) for due in work.due(everything=True)):
        pass
    with engine.transaction(write=False):
        names = [row[0] for row in engine.fetch("SELECT object FROM segments ORDER BY first_ns")]
    engine.close()
    assert len(names) == 3
    (data_dir / "objects" / names[1]).unlink()
    third = data_dir / "objects" / names[2]
    content = bytearray(third.read_bytes())
    middle = len(content) // 3
    content[middle : middle + 50] = bytes(50)
    third.write_bytes(content)


def test_topics_by_name_and_pattern() -> None:
    names = ("/sim_1/odom", "/sim_1/lidar/scan", "/tf", "/sim_1/odom")
    assert chosen_topics(names, None, namespace="/sim_1") == ("/sim_1/odom", "/sim_1/lidar/scan", "/tf")
    assert chosen_topics(names, ["odom", "/tf"], namespace="/sim_1") == ("/sim_1/odom", "/tf")
    assert chosen_topics(names, ["**/scan"], namespace="/") == ("/sim_1/lidar/scan",)
    assert chosen_topics(names, ["*"], namespace="/") == ("/tf",)
    assert full_pattern("odom", "/") == "/odom"


def test_ages() -> None:
    assert (parse_age("10s"), parse_age("1.5ms"), parse_age("2h")) == (10**10, 1_500_000, 7200 * 10**9)
    for bad in ("", "10", "-1s", "31d", "1y"):
        with pytest.raises(InvalidRequestError, match="max_age"):
            parse_age(bad)
