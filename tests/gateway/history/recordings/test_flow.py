"""Recordings from the request to the file, over a real link: states, resume, ranges, and what may go wrong."""

from __future__ import annotations

import asyncio
import itertools
import threading
from collections.abc import AsyncIterator, Callable, Sequence
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio

from gateway.api.models import recordings as models
from gateway.history.recordings.partial_files import PartialFile
from gateway.main import Ready
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from tests.gateway.harness import BACKFILL, CONTROL, DATA, channel, client, running_gateway
from tests.gateway.history.recordings.robot import PART, RecordingRobot, content
from tests.support.waiting import wait_until_async

shared = pytest.mark.asyncio(loop_scope="module")
NUMBERS = itertools.count(1)
BLOB = content(3 * 1024 * 1024 + 17)


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def ready(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Ready]:
    """A gateway that the tests of this file share; its robots are their own."""
    async with running_gateway(tmp_path_factory.mktemp("gateway")) as ready:
        yield ready


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def http(ready: Ready) -> AsyncIterator[httpx.AsyncClient]:
    async with client(ready) as http:
        yield http


@pytest.fixture
def name() -> str:
    """A robot that no other test has."""
    return f"sim_{next(NUMBERS)}"


async def save(http: httpx.AsyncClient, robot: str = "sim_1", **body: Any) -> dict[str, Any]:
    """Ask for a recording."""
    answer = await http.post(f"/api/v1/robots/{robot}/recordings", json=body or {"last_s": 60})
    assert answer.status_code == 202, answer.text
    return dict(answer.json())


async def when(http: httpx.AsyncClient, recording_id: str, good: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """The recording once it is so."""
    async with asyncio.timeout(60):
        while True:
            shown = dict((await http.get(f"/api/v1/recordings/{recording_id}")).json())
            if good(shown):
                models.Recording.model_validate(shown)
                return shown
            await asyncio.sleep(0.01)


def in_state(state: str) -> Callable[[dict[str, Any]], bool]:
    """A condition for `when`."""
    return lambda shown: bool(shown["state"] == state)


@shared
async def test_the_last_minute_of_an_online_robot(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    async with RecordingRobot(ready, name) as robot:
        asked = await save(http, name, last_s=60, topics=[f"/{name}/**"])
        command = await robot.asked()
        saving = command.save_recording
        assert (saving.recording_id, saving.last_ns, list(saving.topics)) == (asked["id"], 60 * 10**9, [f"/{name}/**"])
        assert saving.to_ns - saving.from_ns == 60 * 10**9
        assert abs(saving.to_ns - SystemClock().wall_ns()) < 60 * 10**9
        await when(http, asked["id"], in_state("cutting"))
        await robot.answer(command)
        await robot.offer(asked["id"], BLOB)
        shown = await when(http, asked["id"], in_state("transferring"))
        assert (shown["size_bytes"], shown["messages"]) == (len(BLOB), 42)
        assert (shown["first"], shown["last"]) == ("1970-01-01T00:00:05.000Z", "1970-01-01T00:01:05.000Z")
        early = await http.get(f"/api/v1/recordings/{asked['id']}/file.mcap")
        assert (early.status_code, early.json()["code"]) == (409, "recording_not_stored")
        assert (await robot.deliver(asked["id"], BLOB)).stored
        shown = await when(http, asked["id"], in_state("stored"))
        assert shown["received_bytes"] == len(BLOB)
        answer = await http.get(shown["url"])
        assert answer.content == BLOB
        assert answer.headers["content-type"] == "application/mcap"
        assert f'filename="{name}_1970-01-01T00-00-05Z.mcap"' in answer.headers["content-disposition"]
        await wait_until_async(lambda: not list((ready.data_dir / "incoming").glob(f"*{asked['id']}*")))
        models.RecordingList.model_validate_json((await http.get("/api/v1/recordings")).content)


RANGES: tuple[tuple[dict[str, str], int, int, int], ...] = (
    ({"Range": "bytes=0-0"}, 206, 0, 1),
    ({"Range": "bytes=1048570-1048590"}, 206, 1048570, 1048591),
    ({"Range": "bytes=3145000-"}, 206, 3145000, len(BLOB)),
    ({"Range": "bytes=-5"}, 206, len(BLOB) - 5, len(BLOB)),
    ({"Range": "bytes=0-99999999999"}, 206, 0, len(BLOB)),
    ({"Range": "bytes=0-1,5-6"}, 200, 0, len(BLOB)),
    ({"Range": "bytes=9-3"}, 200, 0, len(BLOB)),
    ({"Range": "bytes=99999999-"}, 416, 0, 0),
    ({"Range": "bytes=0-5", "If-Range": '"other"'}, 200, 0, len(BLOB)),
    ({"If-None-Match": "ETAG"}, 304, 0, 0),
)


@shared
async def test_ranges_of_a_file(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    wrong = []
    async with RecordingRobot(ready, name) as robot:
        asked = await save(http, name)
        await robot.offer(asked["id"], BLOB)
        await robot.deliver(asked["id"], BLOB)
        path = f"/api/v1/recordings/{asked['id']}/file.mcap"
        etag = (await http.get(path)).headers["etag"]
        for headers, status, start, end in RANGES:
            said = {name: value.replace("ETAG", etag) for name, value in headers.items()}
            answer = await http.get(path, headers=said)
            ranged = f"bytes {start}-{end - 1}/{len(BLOB)}" if status == 206 else answer.headers.get("content-range")
            if (answer.status_code, answer.headers.get("content-range")) != (status, ranged):
                wrong.append((headers, answer.status_code, answer.headers.get("content-range")))
            if answer.content != BLOB[start:end]:
                wrong.append((headers, len(answer.content), "bytes"))
    assert wrong == []


@shared
async def test_asked_while_the_robot_is_away(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    async with RecordingRobot(ready, name) as robot:
        pass
    asked = await save(http, name)
    assert asked["state"] == "requested"
    async with RecordingRobot(ready, name, number=2) as robot:
        command = await robot.asked()
        first = command.save_recording
        assert (first.recording_id, first.last_ns) == (asked["id"], 0)
    # It left without an answer, and is asked for the very same span when it comes back.
    async with RecordingRobot(ready, name, number=3) as robot:
        again = (await robot.asked()).save_recording
        assert again == first
        await robot.offer(asked["id"], BLOB)
        assert (await robot.deliver(asked["id"], BLOB)).stored


@shared
async def test_a_lost_link_goes_on_where_it_was(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    async with RecordingRobot(ready, name) as robot:
        asked = await save(http, name)
        await robot.offer(asked["id"], BLOB)
        assert (await robot.wanted()).offset == 0
        await robot.part(asked["id"], BLOB, 0)
        await robot.part(asked["id"], BLOB, PART)
        while (await robot.wanted()).offset < 2 * PART:
            continue
    assert (await when(http, asked["id"], in_state("transferring")))["received_bytes"] == 2 * PART
    async with RecordingRobot(ready, name, number=2) as robot:
        await robot.offer(asked["id"], BLOB)
        assert (await robot.wanted()).offset == 2 * PART
        await robot.offer(asked["id"], BLOB)
        assert (await robot.deliver(asked["id"], BLOB)).stored


@shared
async def test_an_offer_is_answered_before_the_other_lanes_are_open(
    ready: Ready, http: httpx.AsyncClient, name: str
) -> None:
    async with RecordingRobot(ready, name):
        asked = await save(http, name)
    robot = RecordingRobot(ready, name, number=2)
    try:
        await robot.open(BACKFILL)
        await robot.offer(asked["id"], BLOB)
        assert (await robot.wanted()).offset == 0
    finally:
        await robot.__aexit__()


async def test_the_gateway_restarts_in_the_middle(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, RecordingRobot(ready) as robot:
        asked = await save(http)
        await robot.offer(asked["id"], BLOB)
        assert (await robot.wanted()).offset == 0
        await robot.part(asked["id"], BLOB, 0)
        while (await robot.wanted()).offset < PART:
            continue
    async with running_gateway(tmp_path) as ready, client(ready) as http, RecordingRobot(ready) as robot:
        assert (await robot.asked()).save_recording.recording_id == asked["id"]
        await robot.offer(asked["id"], BLOB)
        assert (await robot.wanted()).offset == PART
        await robot.offer(asked["id"], BLOB)
        assert (await robot.deliver(asked["id"], BLOB)).stored
        assert (await http.get(f"/api/v1/recordings/{asked['id']}/file.mcap")).content == BLOB
    async with running_gateway(tmp_path) as ready, client(ready) as http, RecordingRobot(ready) as robot:
        await robot.offer(asked["id"], BLOB)  # it had not heard that it was stored
        assert (await robot.wanted()).stored
        assert (await http.get(f"/api/v1/recordings/{asked['id']}/file.mcap")).content == BLOB


@shared
async def test_a_robot_that_has_nothing(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    async with RecordingRobot(ready, name) as robot:
        for code in ("nothing_there", "black_box_off", "Strange Words!"):
            asked = await save(http, name)
            await robot.answer(await robot.asked(), code=code)
            shown = await when(http, asked["id"], in_state("failed"))
            assert shown["code"] == (code if code.islower() else "failed")
            assert shown["message"]


@shared
async def test_a_cut_found_broken_later(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    async with RecordingRobot(ready, name) as robot:
        asked = await save(http, name)
        await robot.answer(await robot.asked())
        await robot.send(BACKFILL, recording=link_pb2.RecordingPart(recording_id=asked["id"], failed="damaged"))
        assert (await robot.wanted()).unwanted
        assert (await when(http, asked["id"], in_state("failed")))["code"] == "damaged"


@shared
async def test_what_nobody_asked_for_is_not_taken(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    second = f"{name}_other"
    async with RecordingRobot(ready, name) as robot, RecordingRobot(ready, second, session=b"2" * 16) as other:
        await robot.offer("01ARZ3NDEKTSV4RRFFQ69G5FAV", BLOB)
        assert (await robot.wanted()).unwanted
        asked = await save(http, name)
        await other.offer(asked["id"], BLOB)  # another robot's
        assert (await other.wanted()).unwanted
        await robot.offer(asked["id"], BLOB, size_bytes=2**40)
        assert (await robot.wanted()).unwanted
        assert (await when(http, asked["id"], in_state("failed")))["code"] == "too_large"


@shared
async def test_a_part_without_form_ends_the_session(ready: Ready, name: str) -> None:
    recording = "01ARZ3NDEKTSV4RRFFQ69G5FAV"
    parts: tuple[dict[str, Any], ...] = (
        {"recording_id": "../../etc/passwd"},
        {"recording_id": recording, "sha256": b"short"},
        {"recording_id": recording, "data": b"x" * (PART + 1)},
    )
    for number, part in enumerate(parts, 1):
        async with RecordingRobot(ready, name, number=number) as robot:
            await robot.send(BACKFILL, recording=link_pb2.RecordingPart(**part))
            assert (await robot.next("goodbye", BACKFILL)).goodbye.code == "protocol", part


@shared
async def test_deleting(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    async with RecordingRobot(ready, name) as robot:
        asked = await save(http, name)
        await robot.offer(asked["id"], BLOB)
        assert (await robot.wanted()).offset == 0
        await robot.part(asked["id"], BLOB, 0)
        json = {"Content-Type": "application/json"}
        path = f"/api/v1/recordings/{asked['id']}"
        assert (await http.delete(path, headers=json)).json() == {"ok": True}
        while not (await robot.wanted()).unwanted:
            continue
        await wait_until_async(lambda: not list((ready.data_dir / "incoming").glob(f"*{asked['id']}*")))
        assert (await http.get(path)).status_code == 404
        assert (await http.delete(path, headers=json)).status_code == 404
        kept = await save(http, name)
        await robot.offer(kept["id"], BLOB)
        await robot.deliver(kept["id"], BLOB)
        assert (await http.delete(f"/api/v1/recordings/{kept['id']}", headers=json)).status_code == 200
        assert (await http.get(f"/api/v1/recordings/{kept['id']}/file.mcap")).status_code == 404
        await robot.offer(kept["id"], BLOB)
        assert (await robot.wanted()).unwanted


async def test_four_at_a_time_and_sixteen_in_all(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http, RecordingRobot(ready) as robot:
        ids = [(await save(http))["id"] for _ in range(16)]
        refused = await http.post("/api/v1/robots/sim_1/recordings", json={"last_s": 1})
        assert (refused.status_code, refused.json()["code"]) == (429, "too_many")
        blobs = {name: content(100_000, salt=number) for number, name in enumerate(ids)}
        for name in ids:
            await robot.offer(name, blobs[name])
        begun = [(await robot.wanted()).recording_id for _ in range(4)]
        assert len(set(begun)) == 4
        done: set[str] = set()
        waiting = list(begun)
        while len(done) < 16:
            name = waiting.pop(0)
            await robot.part(name, blobs[name], 0)
            while name not in done:
                wanted = await robot.wanted()
                if wanted.stored:
                    done.add(wanted.recording_id)
                elif wanted.recording_id not in waiting:
                    waiting.append(wanted.recording_id)
                assert len(waiting) <= 5
        listed = (await http.get("/api/v1/recordings?robot=sim_1&limit=10")).json()
        rest = (await http.get(f"/api/v1/recordings?limit=10&before={listed['next']}")).json()
        assert [item["id"] for item in listed["recordings"] + rest["recordings"]] == sorted(ids, reverse=True)
        assert rest["next"] is None
        assert (await http.get("/api/v1/recordings?robot=nobody")).json()["recordings"] == []


@shared
async def test_requests_that_cannot_be(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    bodies: tuple[dict[str, Any], ...] = (
        {},
        {"last_s": 0},
        {"last_s": 60, "start": "-60s"},
        {"start": "-10s", "end": "-20s"},
        {"start": "2100-01-01T00:00:00Z", "end": "2100-01-01T00:01:00Z"},
        {"last_s": 60, "topics": [""]},
        {"last_s": 60, "topics": ["/a"] * 65},
        {"last_s": 60, "what": 1},
    )
    async with RecordingRobot(ready, name):
        answers = [await http.post(f"/api/v1/robots/{name}/recordings", json=body) for body in bodies]
        said = [(answer.status_code, answer.json()["code"]) for answer in answers]
        assert said == [(400, "invalid_request")] * len(bodies)
        listed = await http.get("/api/v1/recordings", params={"robot": name})
        assert listed.json() == {"recordings": [], "next": None}
        answer = await http.post("/api/v1/robots/nobody/recordings", json={"last_s": 60})
        assert (answer.status_code, answer.json()["code"]) == (404, "unknown_robot")


@shared
async def test_a_file_that_is_gone_ends_the_download_early(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    async with RecordingRobot(ready, name) as robot:
        asked, folder = await save(http, name), ready.data_dir / "objects" / "recordings"
        others = set(folder.glob("*"))
        await robot.offer(asked["id"], BLOB)
        await robot.deliver(asked["id"], BLOB)
        (path,) = set(folder.glob("*")) - others
        path.unlink()
        with pytest.raises(httpx.RemoteProtocolError):
            await http.get(f"/api/v1/recordings/{asked['id']}/file.mcap")
        assert (await http.get("/healthz")).status_code == 200


async def test_a_disk_that_hangs_holds_nobody_up(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    go_on = threading.Event()
    append = PartialFile.append

    def hang(self: PartialFile, offset: int, pieces: Sequence[bytes]) -> int:
        go_on.wait(60)
        return append(self, offset, pieces)

    monkeypatch.setattr(PartialFile, "append", hang)
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        async with RecordingRobot(ready) as robot, RecordingRobot(ready, "sim_2", session=b"2" * 16) as other:
            try:
                asked = await save(http)
                await robot.offer(asked["id"], BLOB)
                assert (await robot.wanted()).offset == 0
                for number in range(16):  # four times what it may send
                    await robot.part(asked["id"], BLOB, number * PART % len(BLOB))
                for agent in (robot, other):
                    await agent.announce(channel(1, f"/{agent.robot}/chatter", "std_msgs/msg/String"))
                    await agent.samples(1, 1, [b"x"])
                    assert (await agent.next("ack", DATA)).ack.watermarks[0].seq == 1
            finally:
                go_on.set()
            reported = (await robot.wanted()).offset
            while (again := (await robot.wanted()).offset) > reported:
                reported = again
            assert again % PART == 0  # sent back to what is on the disk
            await robot.offer(asked["id"], BLOB)
            assert (await robot.deliver(asked["id"], BLOB)).stored


@shared
async def test_times_that_no_calendar_shows(ready: Ready, http: httpx.AsyncClient, name: str) -> None:
    async with RecordingRobot(ready, name) as robot:
        for size_bytes, stamp_ns in enumerate((-(2**63), 2**63 - 1)):
            asked = await save(http, name)
            await robot.offer(asked["id"], BLOB, from_ns=stamp_ns, to_ns=stamp_ns, messages=2**64 - 1)
            shown = await when(http, asked["id"], in_state("transferring"))
            assert (shown["first"], shown["last"], shown["messages"]) == (None, None, 2**63 - 1)
            box = link_pb2.BlackBox(from_ns=stamp_ns, to_ns=10**9, size_bytes=size_bytes, quota_bytes=7, lost=1)
            await robot.send(CONTROL, statistics=link_pb2.TopicStatistics(link=link_pb2.LinkStatistics(black_box=box)))
            facts = {"size_bytes": size_bytes, "quota_bytes": 7, "lost": 1}
            async with asyncio.timeout(60):
                while (reported := (await http.get(f"/api/v1/robots/{name}")).json()["link"]["black_box"]) is None or (
                    reported["size_bytes"] != size_bytes
                ):
                    continue
            assert reported == {"from": None, "to": "1970-01-01T00:00:01.000Z", **facts}
