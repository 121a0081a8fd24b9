"""Recordings over the deaths of gateways, and with two of them on one database."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from gateway.history.recordings import manager
from gateway.identity.local_key import LOCAL_KEY_FILE
from gateway.main import Ready
from tests.gateway.harness import client, running_gateway
from tests.gateway.history.recordings.robot import PART, RecordingRobot, content
from tests.gateway.history.recordings.test_flow import in_state, save, when
from tests.support.gateways.gateway_process import running
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until_async

BLOB = content(5 * 1024 * 1024 + 3)


@pytest.fixture(autouse=True)
def attentive(monkeypatch: pytest.MonkeyPatch) -> None:
    """A gateway learns of the other's deeds by looking; here it need not be waited for."""
    monkeypatch.setattr(manager, "LOOK_S", 0.1)


async def test_a_robot_that_moves_starts_at_what_the_other_gateway_has(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    shared = {"store_url": postgres.schema(), "objects_url": f"file://{tmp_path}/objects"}
    async with AsyncExitStack() as stack:
        one = await stack.enter_async_context(running_gateway(tmp_path / "1", **shared))
        two = await stack.enter_async_context(running_gateway(tmp_path / "2", **shared))
        http_one = await stack.enter_async_context(client(one))
        http_two = await stack.enter_async_context(client(two))
        async with RecordingRobot(one, number=1) as robot:
            asked = await save(http_one)
            await robot.offer(asked["id"], BLOB)
            assert (await robot.wanted()).offset == 0
            await robot.part(asked["id"], BLOB, 0)
            while (await robot.wanted()).offset < PART:
                continue
        async with RecordingRobot(two, number=2, session=b"2" * 16) as robot:
            assert (await robot.asked()).save_recording.recording_id == asked["id"]
            await robot.offer(asked["id"], BLOB)
            assert (await robot.wanted()).offset == 0  # this one has nothing of it
            await robot.part(asked["id"], BLOB, 0, 1000)
            while (await robot.wanted()).offset < 1000:
                continue
        async with RecordingRobot(one, number=3, session=b"3" * 16) as robot:
            await robot.offer(asked["id"], BLOB)
            assert (await robot.wanted()).offset == PART
            await robot.offer(asked["id"], BLOB)
            assert (await robot.deliver(asked["id"], BLOB)).stored
        async with RecordingRobot(two, number=4, session=b"4" * 16) as robot:
            await robot.offer(asked["id"], BLOB)
            assert (await robot.wanted()).stored
        for http in (http_one, http_two):
            assert (await when(http, asked["id"], in_state("stored")))["received_bytes"] == len(BLOB)
            assert (await http.get(f"/api/v1/recordings/{asked['id']}/file.mcap")).content == BLOB
        await wait_until_async(lambda: not list((tmp_path / "2" / "data" / "incoming").iterdir()))


async def test_asked_at_one_gateway_while_the_robot_is_at_the_other(tmp_path: Path, postgres: PostgresServer) -> None:
    shared = {"store_url": postgres.schema(), "objects_url": f"file://{tmp_path}/objects"}
    async with AsyncExitStack() as stack:
        one = await stack.enter_async_context(running_gateway(tmp_path / "1", **shared))
        two = await stack.enter_async_context(running_gateway(tmp_path / "2", **shared))
        http = await stack.enter_async_context(client(one))
        robot = await stack.enter_async_context(RecordingRobot(two))
        await stack.enter_async_context(
            robot.beating()
        )  # each side learns of the other's deeds by looking, in its time
        path, body = "/api/v1/robots/sim_1/recordings", {"last_s": 60}
        async with asyncio.timeout(60):  # the other gateway knows the robot by the store, where it is a moment later
            while True:
                answer = await http.post(path, json=body)
                if answer.status_code != 404:
                    break
                await asyncio.sleep(0.05)  # who asks without a pause is told that it is too often
        assert answer.status_code == 202, answer.text
        asked = answer.json()
        command = await robot.asked()
        assert command.save_recording.recording_id == asked["id"]
        json = {"Content-Type": "application/json"}
        await robot.offer(asked["id"], BLOB)
        assert (await robot.wanted()).offset == 0
        assert (await http.delete(f"/api/v1/recordings/{asked['id']}", headers=json)).status_code == 200
        await robot.part(asked["id"], BLOB, 0)
        while not (await robot.wanted()).unwanted:
            continue


def key_of(ready: Ready) -> str:
    """Of an administrator, as long as that process runs."""
    return (ready.data_dir / LOCAL_KEY_FILE).read_text().strip()


@pytest.mark.integration
async def test_killed_in_the_middle(tmp_path: Path) -> None:
    """kill -9 after a few parts: the next gateway goes on where the dead one's disk was."""
    with running(tmp_path, "--port", "0", "--grpc-port", "0") as (process, status):
        ready = Ready("127.0.0.1", int(str(status["http_port"])), int(str(status["grpc_port"])), tmp_path / "data")
        async with client(ready, key=key_of(ready)) as http, RecordingRobot(ready) as robot:
            rid = (await save(http))["id"]
            await robot.offer(rid, BLOB)
            assert (await robot.wanted()).offset == 0
            for offset in range(0, 3 * PART, PART):
                await robot.part(rid, BLOB, offset)
            while (await robot.wanted()).offset < 3 * PART:
                continue
            process.kill()
            process.wait()
    async with running_gateway(tmp_path) as ready, client(ready) as http, RecordingRobot(ready, number=2) as robot:
        await robot.offer(rid, BLOB)
        assert (await robot.wanted()).offset == 3 * PART
        await robot.offer(rid, BLOB)
        assert (await robot.deliver(rid, BLOB)).stored
        assert (await http.get(f"/api/v1/recordings/{rid}/file.mcap")).content == BLOB
