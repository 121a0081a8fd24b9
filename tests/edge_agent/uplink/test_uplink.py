"""Sessions one after the other: which gateway, which transport, when again; and what is half dead is found."""

from __future__ import annotations

import asyncio
import logging
import random  # noqa: TID251 - seeded
import socket

import pytest

from edge_agent.config.gateway_address import GatewayAddress, parse_address
from edge_agent.errors import LinkDeadError, LinkError, RefusedError
from edge_agent.uplink.backoff import Backoff
from edge_agent.uplink.grpc import open_grpc
from edge_agent.uplink.reachability import wait_reachable
from edge_agent.uplink.transport import Connection
from edge_agent.uplink.uplink import TRANSPORTS, Uplink
from metaros._proto import link_pb2
from tests.support.gateways.fake_gateway import FakeGateway, fake_gateway
from tests.support.gateways.fake_gateway_ws import websocket_gateway
from tests.support.gateways.gateway_half import GatewayHalf
from tests.support.ports import free_port
from tests.support.robots.uplinks import Owner, feed, running, wait
from tests.support.servers.forward_proxy import forward_proxy


async def test_the_websocket_is_found_where_grpc_does_not_work_and_remembered() -> None:
    tried: list[str] = []

    async def counted(address: GatewayAddress) -> Connection:
        tried.append(address.text)
        return await open_grpc(address)

    async with websocket_gateway() as gateway:
        transports = {**TRANSPORTS, "grpc": counted}
        async with running(gateway.target, transports=transports) as (owner, uplink):
            await wait(lambda: owner.ups == 1)
            feed(owner, uplink, [b"a"])
            await wait(lambda: gateway.half.all_rows(1) == [b"a"])
            assert (owner.facts.transport, len(tried)) == ("websocket", 1)
            await gateway.stop()
            await wait(lambda: len(owner.errors) == 2)
            await gateway.start()
            await wait(lambda: owner.ups == 2)
            assert len(tried) == 1, "gRPC is not tried again before the while is over"
            assert owner.facts.reconnects == 1


async def test_grpc_is_taken_where_the_remembered_websocket_is_gone() -> None:
    async with websocket_gateway() as first, running(first.target) as (owner, _uplink):
        await wait(lambda: owner.ups == 1)
        await first.stop()
        other = FakeGateway(first.half)
        other.port = first.port
        await other.start()
        await wait(lambda: owner.ups == 2)
        assert owner.facts.transport == "grpc"
        await other.stop()
        await first.start()


async def test_the_next_gateway_of_the_list_takes_over_and_nothing_is_lost() -> None:
    half = GatewayHalf()
    async with fake_gateway(half) as one, fake_gateway(half) as two:
        async with running(f"127.0.0.1:{free_port()}", one.target, two.target) as (owner, uplink):
            await wait(lambda: owner.ups == 1)
            assert owner.facts.gateway == one.target
            feed(owner, uplink, [b"a"])
            await one.stop()
            await wait(lambda: len(owner.errors) == 1)
            feed(owner, uplink, [b"b"])
            await wait(lambda: owner.ups == 2)
            assert owner.facts.gateway == two.target
            feed(owner, uplink, [b"c"])
            await wait(lambda: sorted(half.all_rows(1)) == [b"a", b"b", b"c"])  # type: ignore[type-var]
        await one.start()


async def test_a_gateway_of_another_store_is_refused_by_name(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    async with fake_gateway(GatewayHalf(store_id="theirs")) as other, fake_gateway(GatewayHalf(store_id="ours")) as own:
        async with running(other.target, own.target, owner=Owner(store_id="ours")) as (owner, _uplink):
            await wait(lambda: owner.ups == 1)
            assert owner.facts.gateway == own.target
            assert isinstance(owner.errors[0], RefusedError)
    warning = next(record for record in caplog.records if record.levelno == logging.WARNING)
    assert warning.getMessage() == (
        f"link down: {other.target}: gateway said other_store: its store is theirs, ours was ours"
    )


async def test_a_goodbye_sends_the_agent_to_the_next_gateway_at_once() -> None:
    half = GatewayHalf()
    async with fake_gateway(half) as one, fake_gateway(half) as two, running(one.target, two.target) as (owner, _):
        await wait(lambda: owner.ups == 1)
        one.say(link_pb2.GatewayFrame(goodbye=link_pb2.Goodbye(code="shutting_down", retry_after_ms=60_000)))
        await wait(lambda: owner.ups == 2)
        assert owner.facts.gateway == two.target


@pytest.mark.parametrize("kind", ["grpc", "websocket"])
async def test_a_half_open_connection_is_found_by_its_silence(kind: str) -> None:
    half = GatewayHalf()
    half.welcome.heartbeat_s = 0.1  # silent for three of them is dead
    server = fake_gateway(half) if kind == "grpc" else websocket_gateway(half)
    async with server as gateway, running(gateway.target) as (owner, _uplink):
        await wait(lambda: len(owner.errors) >= 1 + (kind == "websocket"))
        assert isinstance(owner.errors[-1], LinkDeadError)
        await wait(lambda: owner.ups == 2)


async def test_a_gateway_that_never_answers_has_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("edge_agent.uplink.uplink.OPEN_S", 0.2)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        target = f"127.0.0.1:{silent.getsockname()[1]}"
        async with fake_gateway() as gateway, running(target, gateway.target) as (owner, _uplink):
            await wait(lambda: owner.ups == 1)
            assert [str(error) for error in owner.errors] == ["no answer within 0.2 s"] * 2


async def test_who_is_not_answered_waits_longer_the_next_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("edge_agent.uplink.uplink.OPEN_S", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        target = f"grpc://127.0.0.1:{silent.getsockname()[1]}"
        async with running(target) as (owner, _uplink):
            await wait(lambda: len(owner.errors) >= 4)
    waited = [str(error).removeprefix("no answer within ") for error in owner.errors]
    assert waited[:4] == ["0.05 s", "0.1 s", "0.2 s", "0.2 s"]


async def test_the_wait_before_the_next_attempt_grows_until_a_session_was_good() -> None:
    owner, waits = Owner(), []

    class Counted(Backoff):
        def next_s(self) -> float:
            waits.append(super().next_s())
            return 0.0

    async def nobody(_address: GatewayAddress) -> None:
        if len(waits) >= 6:
            await asyncio.Event().wait()
        raise LinkError("nobody there")

    uplink = Uplink([parse_address("a:1")], owner, Counted(random.Random(1)), owner.clock, wait_reachable=nobody)
    task = asyncio.create_task(uplink.run())
    await wait(lambda: len(waits) == 6)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    assert all(0.8 * want <= got <= 1.2 * want for got, want in zip(waits, (0.1, 0.2, 0.4, 0.8, 1, 1), strict=True))
    assert owner.number == 0


async def test_each_state_of_the_link_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    attempts: list[GatewayAddress] = []

    async def counted(address: GatewayAddress) -> None:
        attempts.append(address)
        await wait_reachable(address)

    async with fake_gateway() as gateway:
        missing = f"127.0.0.1:{free_port()}"
        async with running(missing, gateway.target, wait_reachable=counted) as (owner, _uplink):
            await wait(lambda: owner.ups == 1)
            await gateway.stop()
            await wait(lambda: len(owner.errors) >= 1)
            before = len(attempts)
            await wait(lambda: len(attempts) >= before + 6)
            await gateway.start()
            await wait(lambda: owner.ups == 2)
    said = [record.getMessage() for record in caplog.records if record.name == "metaros.agent.uplink"]
    ups = [index for index, line in enumerate(said) if line.startswith("link up")]
    assert len(ups) == 2
    for period in (said[: ups[0]], said[ups[0] + 1 : ups[1]]):
        assert period
        assert len(period) == len({*period}), period


@pytest.mark.parametrize("kind", ["grpc", "websocket"])
async def test_a_forward_proxy_of_the_environment_is_used(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    server = fake_gateway() if kind == "grpc" else websocket_gateway()
    async with server as gateway, forward_proxy(gateway.port) as proxy:
        for name in ("http_proxy", "https_proxy"):
            monkeypatch.setenv(name, f"http://127.0.0.1:{proxy.port}")
        for name in ("no_proxy", "NO_PROXY", "no_grpc_proxy"):
            monkeypatch.delenv(name, raising=False)
        async with running("http://gateway.invalid:8080") as (owner, uplink):
            await wait(lambda: owner.ups == 1)
            assert owner.facts.transport == kind
            feed(owner, uplink, [b"a"])
            await wait(lambda: gateway.half.all_rows(1) == [b"a"])
        assert {*proxy.asked} == {"gateway.invalid:8080"}
