"""The uplink over gRPC against a real server in process: it connects, carries, notices loss and comes back."""

from __future__ import annotations

import asyncio
import time
from pathlib import Path

import grpc
import grpc.aio
import pytest

from edge_agent.config.gateway_address import parse_address
from edge_agent.errors import LinkError
from edge_agent.uplink.grpc import open_grpc, system_roots
from metaros._proto import link_pb2, link_pb2_grpc
from tests.support.gateways.fake_gateway import DATA, FakeGateway, fake_gateway
from tests.support.gateways.gateway_half import GatewayHalf
from tests.support.ports import free_port
from tests.support.robots.uplinks import Owner, feed, running, wait
from tests.support.servers.certificates import make_certificate


async def test_samples_arrive_and_are_acknowledged() -> None:
    async with fake_gateway() as gateway, running(f"grpc://{gateway.target}") as (owner, uplink):
        await wait(lambda: owner.ups)
        payloads = [bytes([i]) * 100 for i in range(100)]
        feed(owner, uplink, payloads)
        await wait(lambda: len(gateway.half.all_rows(1)) == 100 and owner.held == 0)
        assert gateway.half.all_rows(1) == payloads
        assert (owner.facts.transport, owner.facts.gateway) == ("grpc", f"grpc://{gateway.target}")


async def test_commands_are_answered() -> None:
    async with fake_gateway() as gateway, running(gateway.target):
        await wait(lambda: gateway.connected)
        gateway.say(link_pb2.GatewayFrame(command=link_pb2.Command(command_id=b"c" * 16)))
        await wait(lambda: gateway.half.results)
        assert gateway.half.results[0].command_id == b"c" * 16


async def test_it_comes_back_after_the_gateway_and_loses_nothing() -> None:
    async with fake_gateway() as gateway, running(gateway.target) as (owner, uplink):
        gateway.acks = False
        await wait(lambda: owner.ups == 1)
        feed(owner, uplink, [b"before"])
        await wait(lambda: gateway.half.all_rows(1))
        await gateway.stop()
        await wait(lambda: owner.errors)
        feed(owner, uplink, [b"meanwhile"])
        await gateway.start()
        gateway.acks = True
        await wait(lambda: owner.ups == 2)
        feed(owner, uplink, [b"after"])
        await wait(lambda: len(gateway.half.all_rows(1)) == 3 and owner.held == 0)
        assert sorted(map(str, gateway.half.all_rows(1))) == sorted(map(str, [b"before", b"meanwhile", b"after"]))
        assert gateway.half.duplicates == 0
        assert owner.facts.reconnects == 1


async def test_it_waits_for_a_gateway_that_is_not_there_yet() -> None:
    gateway = FakeGateway()
    async with running(gateway.target) as (owner, _uplink):
        await asyncio.sleep(0.3)
        assert owner.number == 0, "no session while nobody listens"
        await gateway.start()
        await wait(lambda: gateway.connected)
        await gateway.stop()


async def test_a_goodbye_says_when_to_come_back() -> None:
    async with fake_gateway() as gateway, running(gateway.target) as (owner, _uplink):
        await wait(lambda: owner.ups == 1)
        goodbye = link_pb2.Goodbye(code="shutting_down", retry_after_ms=500)
        said = time.monotonic()
        gateway.say(link_pb2.GatewayFrame(goodbye=goodbye), lane=DATA)
        await wait(lambda: owner.number == 2)
        assert time.monotonic() - said >= 0.45
        assert len(owner.errors) == 1


async def test_the_end_comes_even_while_a_session_fails() -> None:
    for _ in range(20):
        async with fake_gateway() as gateway:
            owner = Owner()
            async with running(gateway.target, owner=owner):
                await wait(lambda g=gateway: g.connected)  # type: ignore[misc]
                stopping = asyncio.create_task(gateway.stop())
                await asyncio.sleep(0)
            assert len(owner.errors) == 1
            await stopping
            await gateway.start()


async def test_control_answers_while_data_is_flooded() -> None:
    half = GatewayHalf(window_bytes=1 << 40, window_batches=1 << 30)
    async with fake_gateway(half) as gateway, running(gateway.target) as (owner, uplink):
        await wait(lambda: owner.ups)
        for _ in range(4):
            feed(owner, uplink, [bytes(1 << 20)] * 10)
        gateway.say(link_pb2.GatewayFrame(command=link_pb2.Command(command_id=b"c" * 16)))
        await wait(lambda: half.results)
        await wait(lambda: len(half.all_rows(1)) == 40)


async def test_nobody_there_is_a_link_error() -> None:
    connection = await open_grpc(parse_address(f"127.0.0.1:{free_port()}"))
    try:
        with pytest.raises(LinkError, match="unavailable"):
            await connection.read()
        with pytest.raises(LinkError):
            await connection.write(b"")
    finally:
        await connection.close()


def test_the_system_has_roots_for_https() -> None:
    roots = system_roots()
    assert roots is None or b"BEGIN CERTIFICATE" in roots


async def test_https_means_tls_with_the_systems_authorities(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    certificate = make_certificate(tmp_path)
    gateway = FakeGateway()
    server = grpc.aio.server()
    link_pb2_grpc.add_LinkServicer_to_server(gateway, server)
    pair = (certificate.with_suffix(".key").read_bytes(), certificate.read_bytes())
    port = server.add_secure_port("localhost:0", grpc.ssl_server_credentials([pair]))
    await server.start()
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    system_roots.cache_clear()
    try:
        async with running(f"https://localhost:{port}") as (owner, _uplink):
            await wait(lambda: owner.ups)
            assert owner.facts.transport == "grpc"
    finally:
        system_roots.cache_clear()
        await server.stop(0)
