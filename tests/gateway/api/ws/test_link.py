"""The link over a WebSocket at the real gateway: the agent's uplink speaks to it, and everybody else is sent away."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager
from pathlib import Path
from typing import Any

import httpx
import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Subprotocol

from gateway.api.ws.close import close_socket
from gateway.api.ws.link import SUBPROTOCOL
from gateway.main import Ready
from gateway.store import Store
from gateway.store.retention import Retention
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from metaros.limits import LIMITS
from tests.edge_agent.parts import accept
from tests.gateway.harness import client, running_gateway
from tests.support.robots.uplinks import Owner, feed, running, wait


@asynccontextmanager
async def lane_socket(ready: Ready, **options: Any) -> AsyncIterator[ClientConnection]:
    """A socket as an agent opens it, not yet with a Hello."""
    url = ready.url.replace("http", "ws", 1) + "/api/v1/link"
    protocol = Subprotocol(SUBPROTOCOL)
    async with connect(url, subprotocols=[protocol], compression=None, max_size=None, proxy=None, **options) as socket:
        assert socket.subprotocol == SUBPROTOCOL
        yield socket


def hello(**changes: Any) -> bytes:
    """The first frame of a control lane."""
    plain = {"protocol": 1, "robot_id": "r", "session_id": bytes(16), "session_number": 1, "lane": 1}
    return link_pb2.AgentFrame(hello=link_pb2.Hello(**{**plain, **changes})).SerializeToString()


async def received(socket: ClientConnection) -> link_pb2.GatewayFrame:
    """The next frame."""
    async with asyncio.timeout(60):
        return link_pb2.GatewayFrame.FromString(await socket.recv(decode=False))


async def close_code(socket: ClientConnection) -> int | None:
    """How the gateway closed it; whatever frames come before are passed over."""
    async with asyncio.timeout(60):
        with contextlib.suppress(ConnectionClosed):
            while True:
                await socket.recv()
    return socket.close_code


async def test_an_agent_that_is_given_the_http_address_gets_its_samples_stored(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        owner = Owner(compression="zstd")
        payloads = [b"%07d" % number * 40 for number in range(500)]
        for payload in payloads[:100]:  # before there is a link: they go by the back-fill lane
            owner.outbox.append(owner.channel.channel_id, "bulk", 0, payload)
        accept(owner.outbox)
        async with running(ready.url, owner=owner) as (_, uplink), client(ready) as http:
            await wait(lambda: owner.ups == 1)
            assert owner.facts.transport == "websocket"
            feed(owner, uplink, payloads[100:])
            feed(owner, uplink, [bytes(3 << 20)])
            await wait(lambda: owner.held == 0)
            robot = (await http.get("/api/v1/robots/r")).json()
            assert robot["state"] == "online"
            assert robot["link"]["transport"] == "websocket"
    stored = await stored_payloads(tmp_path)
    assert sorted(stored) == sorted([*payloads, bytes(3 << 20)])


async def stored_payloads(folder: Path) -> list[bytes]:
    """What a gateway that is over has in its store."""
    retention = Retention(age_s=86400, size_bytes=1 << 30)
    store = Store(folder / "data", clock=SystemClock(), retention=retention, queue_bytes=1 << 20)
    store.start()
    try:
        return [payload for batch in await store.samples("r") for _, _, payload in batch.samples()]
    finally:
        await store.close()


async def test_the_gateways_end_is_reported_and_the_agent_comes_back(tmp_path: Path) -> None:
    owner, stack = Owner(), AsyncExitStack()
    async with running_gateway(tmp_path) as ready:
        uplinks = await stack.enter_async_context(running(ready.url, owner=owner))
        await wait(lambda: owner.ups == 1)
    assert any("shutting_down" in str(error) for error in owner.errors)
    feed(owner, uplinks[1], [b"meanwhile"])
    async with running_gateway(tmp_path, port=ready.http_port):
        await wait(lambda: owner.ups == 2 and owner.held == 0)
        await stack.aclose()
    assert await stored_payloads(tmp_path) == [b"meanwhile"]


async def test_who_is_no_agent_opens_no_link(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        for origin in (ready.url, "http://evil.example", "null"):
            with pytest.raises(InvalidStatus) as caught:
                async with lane_socket(ready, origin=origin):
                    pass
            assert caught.value.response.status_code == 403, origin
            assert json.loads(caught.value.response.body)["code"] == "origin_not_allowed", origin
        url = ready.url.replace("http", "ws", 1) + "/api/v1/link"
        for subprotocols in (None, [Subprotocol("metaros.link.v9")]):
            with pytest.raises(InvalidStatus) as caught:
                await connect(url, subprotocols=subprotocols, proxy=None)
            assert caught.value.response.status_code == 403, subprotocols
        with pytest.raises(InvalidStatus) as caught:
            await connect(url.replace("127.0.0.1", "127.0.0.2"), host="127.0.0.1", proxy=None)
        assert json.loads(caught.value.response.body)["code"] == "host_not_allowed"


async def test_what_is_no_frame_or_no_hello_closes_the_socket_and_no_other(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, lane_socket(ready) as other:
        for first, code in (("a text", 1003), (b"\xff\xff\xff", 1007)):
            async with lane_socket(ready) as socket:
                await socket.send(first)
                assert await close_code(socket) == code
            async with lane_socket(ready) as socket:
                await socket.send(hello(robot_id=f"r{code}"))
                assert (await received(socket)).HasField("welcome")
                await socket.send(first)
                assert await close_code(socket) == code
        for frame, text in ((hello(protocol=9), "protocol 1"), (link_pb2.AgentFrame().SerializeToString(), "Hello")):
            async with lane_socket(ready) as socket:
                await socket.send(frame)
                goodbye = (await received(socket)).goodbye
                assert goodbye.code == "protocol"
                assert text in goodbye.message
                assert await close_code(socket) == 1000
        async with lane_socket(ready) as socket:
            with contextlib.suppress(ConnectionClosed, OSError):
                await socket.send(bytes(LIMITS.frame_bytes + 1))
            # The close frame may be lost, as the gateway does not read the rest.
            assert await close_code(socket) in (1009, 1006)
        await other.send(hello())
        assert (await received(other)).HasField("welcome")
        async with lane_socket(ready) as new:
            await new.send(hello(session_number=2, session_id=bytes([1]) * 16))
            assert (await received(new)).HasField("welcome")
            assert (await received(other)).goodbye.code == "fenced", "by the newer session, whatever carries it"
            assert await close_code(other) == 1000


async def test_an_agent_that_reads_nothing_is_cut(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gateway.ingest.links.OUTBOX_BYTES", 4 << 20)
    monkeypatch.setattr("gateway.ingest.lane_server.GOODBYE_S", 0.05)
    over = asyncio.Event()

    async def close_and_note(*arguments: Any) -> None:
        await close_socket(*arguments)
        over.set()

    monkeypatch.setattr("gateway.api.ws.link.close_socket", close_and_note)
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack, client(ready) as http:
        lanes = [await stack.enter_async_context(lane_socket(ready, max_queue=1)) for _ in range(3)]
        for number, socket in enumerate(lanes, 1):
            await socket.send(hello(lane=number))
            assert (await received(socket)).HasField("welcome")
        await wait_for_state(http, "online")
        body, headers = bytes(900_000), {"Content-Type": "application/cdr"}
        query = {"topic": "/chatter", "type": "std_msgs/msg/String"}
        posts = []
        for _ in range(40):  # one by one, so that the first ones fill what lies between the two
            post = http.post("/api/v1/robots/r/publish", params=query, content=body, headers=headers)
            posts.append(asyncio.create_task(post))
            await asyncio.sleep(0)
        answers = await asyncio.gather(*posts)
        assert {answer.status_code for answer in answers} <= {409, 503}
        await wait_for_state(http, "offline")
        await over.wait()
        assert await close_code(lanes[0]) in (4408, 1006)


async def wait_for_state(http: httpx.AsyncClient, state: str) -> None:
    """Until the gateway says so of the robot."""
    async with asyncio.timeout(60):
        while (await http.get("/api/v1/robots/r")).json()["state"] != state:  # noqa: ASYNC110
            await asyncio.sleep(0.02)
