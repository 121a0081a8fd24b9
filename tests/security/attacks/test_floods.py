"""Floods and hoards: an honest client is answered all the while, whoever holds places is cut, and all comes back.

Nothing here is timed: how much slower honest clients get is measured by `python -m load_tests attacks`.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import ssl
import struct
from contextlib import AsyncExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import grpc
import httpx
import psutil
import pytest

import gateway.main
import gateway.server.connections
from gateway.ingest import lane_server
from gateway.main import Ready
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.limits import LIMITS
from tests.gateway.harness import ScriptedAgent, client, hear, open_socket, running_gateway, say
from tests.support.processes.clock_jump import LeapingClock
from tests.support.waiting import wait_until_async

pytestmark = pytest.mark.integration

SLOW = 500
LOGIN = b"POST /api/v1/auth/login HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
SOURCES = [f"127.0.{number // 200}.{2 + number % 200}" for number in range(1000)]
Pair = tuple[asyncio.StreamReader, asyncio.StreamWriter]


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Heads and handshakes within a second, looked at often, so that tests need not wait for longer."""
    monkeypatch.setattr(gateway.server.connections, "SWEEP_S", 0.1)
    short = replace(LIMITS, head_s=1.0, keep_alive_s=2.0)
    monkeypatch.setattr(
        gateway.main, "ConnectionLimits", partial(gateway.server.connections.ConnectionLimits, limits=short)
    )


async def connected(ready: Ready, source: str = "127.0.0.9") -> Pair:
    """A plain connection from some address of this machine."""
    return await asyncio.open_connection("127.0.0.1", ready.http_port, local_addr=(source, 0))


async def ended(reader: asyncio.StreamReader) -> bytes:
    """What comes until the other end closes."""
    got = b""
    async with asyncio.timeout(120):
        with contextlib.suppress(ConnectionError):
            while piece := await reader.read(65536):
                got += piece
    return got


def files() -> int:
    """How many this process has open."""
    return psutil.Process().num_fds()


async def answered(http: httpx.AsyncClient) -> None:
    """An honest client asks."""
    assert (await http.get("/api/v1/robots")).status_code == 200


@pytest.mark.parametrize("start", [b"GET / HTTP/1.1\r\nHost: localhost\r\nX-Slow: a", LOGIN, b"", b"\r\n"])
async def test_500_slow_heads_are_cut_and_leave_nothing_behind(tmp_path: Path, start: bytes, impatient: None) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        await answered(http)
        before, memory = files(), psutil.Process().memory_info().rss
        pairs = [await connected(ready, SOURCES[number]) for number in range(SLOW)]
        for reader, writer in pairs:
            writer.write(start)
            if reader.at_eof():
                writer.close()
        await answered(http)
        ends = [asyncio.create_task(ended(reader)) for reader, _ in pairs]
        for _ in range(3):
            for (_, writer), end in zip(pairs, ends, strict=True):
                if not end.done():
                    writer.write(b"a" if start else b"")
            await answered(http)
        await asyncio.gather(*ends)
        for _, writer in pairs:
            writer.close()
        await wait_until_async(lambda: files() <= before + 5, timeout_s=120)
        assert psutil.Process().memory_info().rss - memory < 128 * 2**20
        await answered(http)


async def test_500_slow_bodies_hold_up_nobody(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, anonymous_requests_per_s=0) as ready, client(ready) as http:
        await answered(http)
        before = files()
        pairs = [await connected(ready, SOURCES[number]) for number in range(SLOW)]
        for _, writer in pairs:
            writer.write(LOGIN + b"Content-Length: 60000\r\n\r\n ")
        await answered(http)
        await answered(http)
        for _, writer in pairs:
            writer.close()
        await wait_until_async(lambda: files() <= before + 5, timeout_s=120)
        await answered(http)


async def test_stalled_handshakes_are_counted_and_cut(tmp_path: Path, impatient: None) -> None:
    async with running_gateway(tmp_path, tls="on") as ready:
        context = ssl.create_default_context(cadata=ready.roots_pem)
        async with httpx.AsyncClient(base_url=ready.url, verify=context, trust_env=False) as http:
            assert (await http.get("/healthz")).status_code == 200
            before = files()
            pairs = [await connected(ready, SOURCES[number]) for number in range(SLOW)]
            for _, writer in pairs[::2]:
                writer.write(b"\x16\x03\x01\x02\x00")  # the beginning of a ClientHello
            assert (await http.get("/healthz")).status_code == 200
            await asyncio.gather(*(ended(reader) for reader, _ in pairs))
            for _, writer in pairs:
                writer.close()
            await wait_until_async(lambda: files() <= before + 5, timeout_s=120)
            assert (await http.get("/healthz")).status_code == 200


async def test_a_head_that_is_too_large_is_431(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready:
        for head in (
            b"X: " + b"a" * 9000 + b"\r\n\r\n",
            b"X: " + b"a" * 9000,
            b"A: b\r\n" * 2000,
        ):
            reader, writer = await connected(ready)
            writer.write(b"GET / HTTP/1.1\r\nHost: localhost\r\n" + head)
            assert (await ended(reader)).startswith(b"HTTP/1.1 431 "), head[:20]
            writer.close()


async def test_a_socket_and_its_viewer_outlive_every_deadline_of_a_head(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(gateway.server.connections, "SWEEP_S", 0.02)
    clock = LeapingClock()
    async with running_gateway(tmp_path, clock=clock) as ready, open_socket(ready, "/api/v1/stream") as stream:
        await hear(stream, "welcome")
        for _ in range(2):
            reader, writer = await connected(ready)
            end = asyncio.create_task(ended(reader))
            while not end.done():  # it may not have been seen yet
                clock.leap(LIMITS.head_s)
                await asyncio.wait({end}, timeout=0.05)
            assert end.result() == b""
            writer.close()
        await say(stream, op="nonsense")
        assert (await hear(stream, "error"))["code"] == "invalid_request"


async def test_a_flood_of_wrong_passwords_and_somebody_else_signs_in(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, sign_ins_per_min=0.5) as ready:
        admin = (ready.data_dir / "local.key").read_text().strip()
        made = {"name": "ada", "role": "viewer", "robots": ["*"], "password": "correct horse battery"}
        async with client(ready, key=admin) as owner:
            assert (await owner.post("/api/v1/users", json=made)).status_code == 201
        codes: list[int] = []

        async def guess(number: int) -> None:
            body = b'{"name":"user%d","password":"wrong horse battery"}' % number
            reader, writer = await connected(ready, "127.0.0.66")
            writer.write(LOGIN + b"Connection: close\r\nContent-Length: %d\r\n\r\n" % len(body) + body)
            codes.append(int((await ended(reader))[9:12]))
            writer.close()

        flood = [asyncio.create_task(guess(number)) for number in range(60)]
        transport = httpx.AsyncHTTPTransport(local_address="127.0.0.77")
        async with httpx.AsyncClient(base_url=ready.url, transport=transport, timeout=120) as honest:
            answer = await honest.post("/api/v1/auth/login", json={"name": "ada", "password": made["password"]})
            assert answer.status_code == 200
        await asyncio.gather(*flood)
        assert set(codes) == {401, 429}
        assert codes.count(401) <= 3


async def test_bodies_without_end_are_refused_or_cut(tmp_path: Path) -> None:
    chunk = b"10000\r\n" + bytes(65536) + b"\r\n"
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        for head in (b"Transfer-Encoding: chunked\r\n\r\n", b"Content-Length: 99999999\r\n\r\n"):
            reader, writer = await connected(ready)
            writer.write(LOGIN + head)
            end = asyncio.create_task(ended(reader))
            with contextlib.suppress(ConnectionError):
                for _ in range(2000):
                    writer.write(chunk)
                    await writer.drain()
                    if end.done():
                        break
            assert end.done() or await end is not None
            writer.close()
            await answered(http)


async def test_brackets_without_end_are_an_invalid_request(tmp_path: Path) -> None:
    async with running_gateway(tmp_path) as ready, client(ready) as http:
        for body in (b"[" * 60_000, b'{"a":' * 10_000, b"[" * 1_000_000, b'{"name":' + b"[" * 900_000):
            sent = await http.post("/api/v1/auth/login", content=body, headers={"Content-Type": "application/json"})
            assert (sent.status_code, sent.json()["code"]) == (400, "invalid_request")


async def upgraded(ready: Ready) -> Pair:
    """A WebSocket without a library that would keep us from misbehaving."""
    reader, writer = await connected(ready)
    writer.write(
        b"GET /api/v1/stream HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n"
    )
    assert (await reader.readuntil(b"\r\n\r\n")).startswith(b"HTTP/1.1 101 ")
    return reader, writer


PING = struct.pack("!BB4s", 0x89, 0x80 | 100, bytes(4)) + bytes(100)
TINY = struct.pack("!BB4sB", 0x00, 0x81, bytes(4), 97)
BIG = struct.pack("!BBQ4s", 0x81, 0xFF, 1 << 20, bytes(4))
FLOODS = {
    "pings": itertools.repeat(PING * 100),
    "one message of one-byte frames": itertools.chain([b"\x01" + TINY[1:]], itertools.repeat(TINY * 500)),
    "messages of one byte": itertools.repeat((b"\x81" + TINY[1:]) * 500),
    "a large message": itertools.chain([BIG], itertools.repeat(b"a" * 65536)),
}


@pytest.mark.parametrize("kind", FLOODS)
async def test_a_socket_that_floods_is_ended_and_others_are_not(tmp_path: Path, kind: str) -> None:
    async with running_gateway(tmp_path) as ready, open_socket(ready, "/api/v1/stream") as honest:
        await hear(honest, "welcome")
        reader, writer = await upgraded(ready)
        end = asyncio.create_task(ended(reader))
        async with asyncio.timeout(120):
            with contextlib.suppress(ConnectionError):
                for piece in FLOODS[kind]:
                    writer.write(piece)
                    await writer.drain()
                    if end.done():
                        break
            await end
        writer.close()
        await say(honest, op="nonsense")
        assert (await hear(honest, "error"))["code"] == "invalid_request"


async def test_lanes_that_say_nothing_keep_no_robot_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lane_server, "HELLO_S", 3.0)
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack:
        target, options = f"127.0.0.1:{ready.grpc_port}", [("grpc.use_local_subchannel_pool", 1)]
        calls: list[Any] = []
        for _ in range(5):
            channel = await stack.enter_async_context(grpc.aio.insecure_channel(target, options=options))
            calls += [link_pb2_grpc.LinkStub(channel).Connect() for _ in range(100)]
        async with ScriptedAgent(ready, "honest"), client(ready) as http:
            assert (await http.get("/api/v1/robots/honest")).json()["state"] == "online"
            channel = await stack.enter_async_context(grpc.aio.insecure_channel(target, options=options))
            for _ in range(500):  # opened and taken back at once
                link_pb2_grpc.LinkStub(channel).Connect().cancel()
            assert (await http.get("/api/v1/robots/honest")).json()["state"] == "online"
        hung = await asyncio.wait_for(asyncio.gather(*(call.read() for call in calls), return_exceptions=True), 120)
        assert all(
            got is grpc.aio.EOF or isinstance(got, (grpc.aio.AioRpcError, link_pb2.GatewayFrame)) for got in hung
        )


def test_files_are_as_many_as_the_system_allows() -> None:
    import resource

    hard = resource.getrlimit(resource.RLIMIT_NOFILE)[1]
    allowed = gateway.server.connections.open_files()
    assert allowed is None or min(hard, 65_536) <= allowed <= max(hard, 65_536)
