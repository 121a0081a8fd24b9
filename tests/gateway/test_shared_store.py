"""Two gateways on one store: what an agent is told of its watermarks when it comes back from the other one."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.settings import Settings
from metaros._proto import link_pb2
from metaros.errors import ConfigError
from tests.gateway.harness import DATA, EPOCH, ScriptedAgent, channel, running_gateway
from tests.support.servers.postgres import PostgresServer


@pytest.mark.parametrize("ended", [True, False])
async def test_an_agent_that_was_remote_meanwhile_is_reported_what_the_store_has(
    tmp_path: Path, postgres: PostgresServer, ended: bool
) -> None:
    url = postgres.schema()
    state = link_pb2.StreamState(stream_id=1, epoch=EPOCH, first_seq=1, last_seq=100)
    topic = channel(1, "/sim_1/image", "std_msgs/msg/String")
    async with (
        running_gateway(tmp_path / "one", store_url=url) as one,
        running_gateway(tmp_path / "two", store_url=url) as two,
    ):
        first = ScriptedAgent(one, number=1)
        await first.__aenter__()
        await first.announce(topic)
        await first.samples(1, 1, [b"x"] * 10)
        assert (await first.next("ack", DATA)).ack.watermarks[0].seq == 10
        if ended:
            await first.__aexit__()
        async with ScriptedAgent(two, number=2) as second:
            await second.announce(topic)
            await second.samples(1, 11, [b"x"] * 10)
            assert (await second.next("ack", DATA)).ack.watermarks[0].seq == 20
        third = ScriptedAgent(one, number=3)
        await third.open(DATA, [state])
        assert [mark.seq for mark in third.welcomes[DATA].watermarks if mark.epoch == EPOCH] == [20]
        await third.__aexit__()
        if not ended:
            await first.__aexit__()


async def test_a_gateway_with_another_master_key_does_not_join_a_cluster(
    tmp_path: Path, postgres: PostgresServer
) -> None:
    shared = {"store_url": postgres.schema(), "cluster": ("tcp/127.0.0.1:1",)}  # no router: that is no matter here
    async with running_gateway(tmp_path / "one", **shared):
        with pytest.raises(ConfigError, match="--master-key"):
            async with running_gateway(tmp_path / "two", **shared):
                pass
        async with running_gateway(tmp_path / "three", master_key=tmp_path / "one" / "data" / "master.key", **shared):
            pass


def test_a_cluster_is_of_one_database() -> None:
    with pytest.raises(ConfigError, match="postgresql://"):
        Settings(cluster=("tcp/127.0.0.1:7447",))
    for endpoint in ("7447", "tcp/host", "tcp/host:0", "tcp/host:99999", "http://host:1", "udp/host:1"):
        with pytest.raises(ConfigError, match="tcp/host:7447"):
            Settings(store_url="postgresql://x@h/d", cluster=(endpoint,))
