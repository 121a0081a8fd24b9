"""Gateways on one PostgreSQL store: a robot may go from one to another, and the store may go away for a while."""

from __future__ import annotations

import asyncio
import json
import signal
from pathlib import Path

import pytest

from gateway.settings import Settings
from gateway.store.engine import shown
from metaros._proto import link_pb2
from metaros.errors import ConfigError
from tests.gateway.harness import (
    BACKFILL,
    CONTROL,
    DATA,
    EPOCH,
    ScriptedAgent,
    channel,
    client,
    running_gateway,
)
from tests.support.gateways.gateway_process import running
from tests.support.processes.processes import END_S
from tests.support.servers.postgres import PostgresServer

BULK = channel(7, "/sim_1/scan", "std_msgs/msg/String")


async def open_all(agent: ScriptedAgent, last_seq: int) -> int:
    """Say hello on every lane; the gateway's watermark of the stream."""
    state = link_pb2.StreamState(stream_id=7, epoch=EPOCH, first_seq=1, last_seq=last_seq)
    for lane in (CONTROL, DATA, BACKFILL):
        await agent.open(lane, [state] if lane == DATA else [])
    await agent.announce(BULK)
    return int(agent.welcomes[DATA].watermarks[0].seq)


async def acked(agent: ScriptedAgent) -> int:
    """What the next Ack says."""
    ack = (await agent.next("ack", DATA, timeout_s=60)).ack
    return int(ack.watermarks[0].seq)


async def test_a_robot_goes_from_one_gateway_to_another_and_back(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    async with running_gateway(tmp_path / "1", store_url=url) as one:
        async with running_gateway(tmp_path / "2", store_url=url) as two:
            stored = 0
            stores = set()
            for number, ready in enumerate((one, two, one, two, one), 1):
                agent = ScriptedAgent(ready, number=number, session=bytes([number]) * 16)
                assert await open_all(agent, stored + 3) == stored
                stores.add(agent.welcomes[DATA].store_id)
                await agent.samples(7, max(1, stored), [b"x"] * 4)  # the last one again
                stored = max(1, stored) + 3
                assert await acked(agent) == stored
                await agent.__aexit__()
            assert len(stores) == 1
            assert "" not in stores


async def test_the_store_goes_away_and_the_link_stays(tmp_path: Path, postgres: PostgresServer) -> None:
    server = PostgresServer()
    try:
        server.start()
        async with running_gateway(tmp_path, store_url=server.url) as ready, client(ready) as http:
            async with ScriptedAgent(ready) as agent:
                await agent.announce(BULK)
                await agent.samples(7, 1, [b"a"])
                assert await acked(agent) == 1
                await asyncio.to_thread(server.kill)
                await agent.samples(7, 2, [b"b"])
                later = (await agent.next("retry_later", DATA, timeout_s=60)).retry_later
                assert later.reason == "store_error"
                assert (await http.get("/readyz")).status_code == 503
                await agent.samples(7, 3, [b"c"])  # dropped, as it has not been resumed
                await asyncio.to_thread(server.start)
                async with asyncio.timeout(60):
                    while (await http.get("/readyz")).status_code != 200:
                        continue
                await agent.send(DATA, resumed=link_pb2.Resumed(token=later.token))
                await agent.samples(7, 2, [b"b", b"c"])
                assert await acked(agent) == 3
                assert (await http.get("/api/v1/robots/sim_1")).json()["state"] == "online"
    finally:
        server.close()


def test_the_program_takes_a_url_and_hides_the_password(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema().replace("metaros@", "metaros:secret@")
    with running(tmp_path, "--port", "0", "--grpc-port", "0", "--store", url) as (process, status):
        process.send_signal(signal.SIGTERM)
        output, _ = process.communicate(timeout=END_S)
    assert status["ready"]
    assert f"store {shown(url)}\n" in output
    assert "secret" not in output + json.dumps(status)
    assert process.returncode == 0


def test_a_url_that_is_none_is_refused() -> None:
    with pytest.raises(ConfigError, match="--store is a URL"):
        Settings(store_url="mysql://host/db")
    with pytest.raises(ConfigError, match="--event-retention-days"):
        Settings(event_retention_days=0)
    assert "secret" not in repr(Settings(store_url="postgresql://u:secret@h/d"))
