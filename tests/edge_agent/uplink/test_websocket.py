"""The uplink over WebSockets against a real server in process: the same contract as over gRPC."""

from __future__ import annotations

import hashlib

import pytest

from edge_agent.config.gateway_address import parse_address
from edge_agent.errors import LinkError
from edge_agent.uplink.websocket import open_websocket
from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.limits import LIMITS
from tests.support.gateways.fake_gateway_ws import WebSocketGateway, websocket_gateway
from tests.support.gateways.gateway_half import DATA, GatewayHalf
from tests.support.ports import free_port
from tests.support.robots.uplinks import Owner, feed, running, wait


def url(gateway: WebSocketGateway) -> str:
    """With a path, so that only the WebSocket is tried."""
    return f"http://{gateway.target}/fleet"


async def test_samples_arrive_and_are_acknowledged() -> None:
    async with websocket_gateway() as gateway, running(url(gateway)) as (owner, uplink):
        await wait(lambda: owner.ups)
        payloads = [bytes([i]) * 100 for i in range(100)]
        feed(owner, uplink, payloads)
        await wait(lambda: len(gateway.half.all_rows(1)) == 100 and owner.held == 0)
        assert gateway.half.all_rows(1) == payloads
        assert gateway.paths == ["/fleet/api/v1/link"] * 3
        assert (owner.facts.transport, owner.facts.gateway) == ("websocket", url(gateway))


async def test_it_comes_back_after_the_gateway_and_loses_nothing() -> None:
    async with websocket_gateway() as gateway, running(url(gateway)) as (owner, uplink):
        gateway.acks = False
        await wait(lambda: owner.ups == 1)
        feed(owner, uplink, [b"before"])
        await wait(lambda: gateway.half.all_rows(1))
        await gateway.stop()
        await wait(lambda: owner.errors)
        feed(owner, uplink, [b"meanwhile"])
        await gateway.start()
        gateway.acks = True
        await wait(lambda: len(gateway.half.all_rows(1)) == 2 and owner.held == 0)
        assert gateway.half.duplicates == 0


async def test_control_answers_while_data_is_flooded() -> None:
    half = GatewayHalf(window_bytes=1 << 40, window_batches=1 << 30)
    async with websocket_gateway(half) as gateway, running(url(gateway)) as (owner, uplink):
        await wait(lambda: owner.ups)
        for _ in range(4):
            feed(owner, uplink, [bytes(1 << 20)] * 10)
        gateway.say(link_pb2.GatewayFrame(command=link_pb2.Command(command_id=b"c" * 16)))
        await wait(lambda: half.results)
        await wait(lambda: len(half.all_rows(1)) == 40)


async def test_a_goodbye_ends_the_session() -> None:
    async with websocket_gateway() as gateway, running(url(gateway)) as (owner, _uplink):
        await wait(lambda: owner.ups == 1)
        gateway.say(link_pb2.GatewayFrame(goodbye=link_pb2.Goodbye(code="shutting_down")), lane=DATA)
        await wait(lambda: owner.ups == 2)
        assert str(owner.errors[0]) == "gateway said shutting_down"


async def test_compressed_batches_are_expanded_on_the_other_side() -> None:
    async with (
        websocket_gateway() as gateway,
        running(url(gateway), owner=Owner(compression="zstd")) as (owner, uplink),
    ):
        await wait(lambda: owner.ups)
        payloads = [hashlib.sha512(b"%d" % i).hexdigest().encode() * 8 for i in range(50)]
        feed(owner, uplink, payloads)
        await wait(lambda: owner.held == 0)
        assert gateway.half.all_rows(1) == payloads
        assert gateway.received_bytes < sum(map(len, payloads)) / 5


async def test_what_cannot_be_opened_is_a_link_error() -> None:
    with pytest.raises(LinkError):
        await open_websocket(parse_address(f"http://127.0.0.1:{free_port()}"))
    async with websocket_gateway(subprotocol="something.else") as other:
        with pytest.raises(LinkError):
            await open_websocket(parse_address(url(other)))


async def test_a_frame_that_is_none_breaks_the_protocol() -> None:
    async with websocket_gateway() as gateway:
        connection = await open_websocket(parse_address(url(gateway)))
        listener = gateway._listener
        assert listener is not None
        (socket,) = listener.connections
        await socket.send(b"\xff\xff")
        with pytest.raises(FrameError):
            await connection.read()
        await socket.send(bytes(LIMITS.frame_bytes + 1))
        with pytest.raises(LinkError):
            await connection.read()
        with pytest.raises(LinkError):
            await connection.write(b"x")
        await connection.close()
