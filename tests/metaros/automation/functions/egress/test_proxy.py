"""The proxy of a worker: what it connects to, what it refuses, and that nothing of it stays."""

from __future__ import annotations

import asyncio
import contextlib
import dataclasses
import os
import socket
from collections.abc import AsyncIterator, Awaitable, Callable, Sequence
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from metaros.automation.functions.egress.proxy import Egress
from metaros.automation.functions.egress.rules import EgressRules, parse_egress
from metaros.limits import LIMITS, Limits
from tests.support.waiting import wait_until_async

Serve = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]
NAMES = {
    "local.example": ["127.0.0.1"],
    "mixed.example": ["93.184.216.34", "10.0.0.1"],
    "cloud.example": ["169.254.169.254"],
    "six.example": ["::1"],
    "none.example": [],
    "two.example": ["127.0.0.2", "127.0.0.1"],
}


async def resolve(host: str, port: int) -> Sequence[str]:
    if host not in NAMES:
        raise OSError("no such name")
    return NAMES[host]


async def echo(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await reader.read(65_536):
        writer.write(data)
        await writer.drain()
    writer.close()


@asynccontextmanager
async def far_end(serve: Serve) -> AsyncIterator[int]:
    """A server; its port."""
    tasks: list[asyncio.Task[None]] = []

    async def one(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        tasks.append(task)
        try:
            await serve(reader, writer)
        except OSError:
            pass
        finally:
            writer.transport.abort()

    server = await asyncio.start_server(one, "127.0.0.1", 0)
    yield server.sockets[0].getsockname()[1]
    server.close()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


class Near:
    """The worker's side of a proxy. `notes` is what its log says."""

    def __init__(self, port: int, notes: list[str], egress: Egress) -> None:
        self.port, self.notes, self.egress = port, notes, egress

    async def open(self, request: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        reader, writer = await asyncio.open_connection("127.0.0.1", self.port)
        writer.write(request.encode("latin-1"))
        return reader, writer

    async def whole(self, request: str) -> str:
        """All that comes back."""
        reader, writer = await self.open(request)
        answer = await reader.read()
        writer.close()
        return answer.decode("latin-1")

    async def connect(self, target: str) -> tuple[asyncio.StreamReader, asyncio.StreamWriter]:
        reader, writer = await self.open(f"CONNECT {target} HTTP/1.1\r\nHost: {target}\r\n\r\n")
        assert await reader.readuntil(b"\r\n\r\n") == b"HTTP/1.1 200 Connection established\r\n\r\n"
        return reader, writer


@asynccontextmanager
async def proxy(patterns: str, *, bound: EgressRules | None = None, limits: Limits = LIMITS) -> AsyncIterator[Near]:
    """A proxy; at its end no connection of it may be left."""
    notes: list[str] = []
    egress = Egress(bound=bound, resolve=resolve, limits=limits)
    served = egress.proxy(parse_egress(patterns), notes.append)
    listener = socket.create_server(("127.0.0.1", 0))
    port = listener.getsockname()[1]
    await served.start(listener)
    try:
        yield Near(port, notes, egress)
    finally:
        await served.close()
        egress.close()
    assert egress.connections == 0


async def test_a_tunnel_carries_both_ways_and_ends() -> None:
    async with far_end(echo) as port, proxy(f"127.0.0.1:{port}") as near:
        reader, writer = await near.connect(f"127.0.0.1:{port}")
        data = os.urandom(3_000_000)
        sending = asyncio.create_task(_send(writer, data))
        assert await reader.readexactly(len(data)) == data
        await sending
        writer.write_eof()
        assert await reader.read() == b""
        writer.close()
        await wait_until_async(lambda: near.egress.connections == 0)


async def _send(writer: asyncio.StreamWriter, data: bytes) -> None:
    writer.write(data)
    await writer.drain()


@pytest.mark.parametrize(
    ("target", "status", "reason"),
    [
        ("127.0.0.1:1", 403, "METAROS_EGRESS does not allow it"),
        ("other.example:443", 403, "METAROS_EGRESS does not allow it"),
        ("169.254.169.254:80", 403, "METAROS_EGRESS does not allow it"),
        ("[::1]:443", 403, "METAROS_EGRESS does not allow it"),
        ("local.example:443", 403, "127.0.0.1 that is not public"),
        ("LOCAL.example.:443", 403, "127.0.0.1 that is not public"),
        ("mixed.example:443", 403, "10.0.0.1 that is not public"),
        ("six.example:443", 403, "::1 that is not public"),
        ("cloud.example:8443", 403, "169.254.169.254 that is not public"),
        ("none.example:443", 502, "no address"),
        ("gone.example:443", 502, "cannot be looked up"),
        ("local.example", 400, "no HOST:PORT"),
        ("local.example:0", 400, "no address"),
        ("local.example:99999", 400, "no address"),
        ("a@local.example:443", 400, "no HOST:PORT"),
        ("local.example:443/x", 400, "no HOST:PORT"),
        ("lo\tcal.example:443", 400, "no HTTP/1 request"),
    ],
)
async def test_what_is_refused(target: str, status: int, reason: str) -> None:
    allowed = "local.example, mixed.example, six.example, private:cloud.example:8443, none.example, gone.example"
    async with proxy(allowed) as near:
        answer = await near.whole(f"CONNECT {target} HTTP/1.1\r\n\r\n")
        assert answer.startswith(f"HTTP/1.1 {status} ")
        assert reason in answer
        assert len(near.notes) == 1
        assert reason in near.notes[0]


@pytest.mark.parametrize(
    "request_line", ["GET / HTTP/1.1", "nonsense", "GET https://a.example/ HTTP/1.1", "GET x HTTP/1.1"]
)
async def test_what_is_no_request_for_a_proxy(request_line: str) -> None:
    async with proxy("*") as near:
        assert (await near.whole(f"{request_line}\r\n\r\n")).startswith("HTTP/1.1 400 ")


async def test_private_names_are_reached_where_they_are_asked_for() -> None:
    async with far_end(echo) as port, proxy(f"private:local.example:{port}, private:two.example:{port}") as near:
        for name in ("local.example", "two.example"):  # of two the first one does not answer
            reader, writer = await near.connect(f"{name}:{port}")
            writer.write(b"hello")
            assert await reader.readexactly(5) == b"hello"
            writer.close()


@pytest.mark.parametrize(
    ("bound", "open_to_it"),
    [("none", False), ("*.example", False), ("private:local.example:{port}", True), ("local.example:{port}", False)],
)
async def test_the_operator_bounds_it(bound: str, open_to_it: bool) -> None:
    async with far_end(echo) as port:
        rules = EgressRules() if bound == "none" else parse_egress(bound.format(port=port))
        async with proxy(f"private:local.example:{port}", bound=rules) as near:
            answer = await near.open(f"CONNECT local.example:{port} HTTP/1.1\r\n\r\n")
            status = await answer[0].readuntil(b"\r\n")
            assert (b" 200 " in status) == open_to_it
            answer[1].close()


async def record(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Answers with the head and the body it got; leaves the connection open."""
    head = await reader.readuntil(b"\r\n\r\n")
    body = b""
    if b"chunked" in head:
        body = await reader.readuntil(b"0\r\n\r\n")
    elif b"content-length: 4" in head:
        body = await reader.readexactly(4)
    writer.write(b"HTTP/1.1 100 Continue\r\n\r\nHTTP/1.1 200 OK\r\nConnection: keep-alive\r\nX-Own: yes\r\n")
    text = head + b"|" + body
    writer.write(b"Content-Length: %d\r\n\r\n" % len(text) + text)
    await reader.read()


@pytest.mark.parametrize(
    ("fields", "sent", "got"),
    [
        ("Content-Length: 4\r\n", "bodyGET http://evil/ HTTP/1.1\r\n\r\n", "body"),
        ("", "", ""),
        ("Transfer-Encoding: chunked\r\n", "3;x=y\r\nabc\r\n0\r\n\r\nGET http://evil/", "3;x=y\r\nabc\r\n0\r\n\r\n"),
    ],
)
async def test_a_plain_request_goes_on_alone(fields: str, sent: str, got: str) -> None:
    async with far_end(record) as port, proxy(f"127.0.0.1:{port}") as near:
        head = f"POST http://127.0.0.1:{port}/a/b?c=d#e HTTP/1.1\r\nHost: spoofed\r\nX-Mine: 1\r\n{fields}"
        head += "Proxy-Authorization: Basic abc\r\nConnection: X-Hop\r\nX-Hop: 1\r\n\r\n"
        reader, writer = await near.open(head + sent)
        assert await reader.readuntil(b"\r\n\r\n") == b"HTTP/1.1 100 Continue\r\n\r\n"
        answer = (await reader.readuntil(b"\r\n\r\n")).decode()
        assert answer.startswith("HTTP/1.1 200 OK\r\nX-Own: yes\r\n")
        assert answer.endswith("Connection: close\r\n\r\n")
        size = int(answer.partition("Content-Length: ")[2].partition("\r\n")[0])
        reported, _, body = (await reader.readexactly(size)).decode().partition("|")
        assert body == got
        lines = reported.split("\r\n")
        assert lines[:2] == ["POST /a/b?c=d HTTP/1.1", f"Host: 127.0.0.1:{port}"]
        assert "x-mine: 1" in lines
        assert "Connection: close" in lines
        assert "x-hop" not in reported
        assert "proxy-auth" not in reported
        writer.close()


@pytest.mark.parametrize(
    "fields",
    [
        *("Content-Length: 1\r\nContent-Length: 2\r\n", "Content-Length: 1\r\nTransfer-Encoding: chunked\r\n"),
        *(
            "Transfer-Encoding: gzip, chunked\r\n",
            "Content-Length: -1\r\n",
            "no header\r\n",
            "X : 1\r\n",
            "X: a\nY: b\r\n",
        ),
    ],
)
async def test_a_request_that_two_could_read_in_two_ways(fields: str) -> None:
    async with proxy("127.0.0.1:9") as near:
        answer = await near.whole(f"POST http://127.0.0.1:9/ HTTP/1.1\r\n{fields}\r\n")
        assert answer.startswith("HTTP/1.1 400 ")


async def test_a_head_is_bounded() -> None:
    async with proxy("*") as near:
        reader, writer = await near.open("CONNECT a.example:443 HTTP/1.1\r\nX: " + "x" * 200_000)
        assert (await reader.readuntil(b"\r\n")).startswith(b"HTTP/1.1 431 ")
        writer.close()


async def test_connections_are_bounded_and_come_free() -> None:
    limits = dataclasses.replace(LIMITS, function_egress_connections=3)
    async with far_end(echo) as port, proxy(f"127.0.0.1:{port}", limits=limits) as near:
        open_now = [await near.connect(f"127.0.0.1:{port}") for _ in range(3)]
        refused = await near.whole(f"CONNECT 127.0.0.1:{port} HTTP/1.1\r\n\r\n")
        assert refused.startswith("HTTP/1.1 503 ")
        open_now.pop()[1].close()
        await wait_until_async(lambda: near.egress.connections == 2)
        open_now.append(await near.connect(f"127.0.0.1:{port}"))
        for _, writer in open_now:
            writer.close()


async def test_all_workers_together_are_bounded() -> None:
    limits = dataclasses.replace(LIMITS, function_egress_all=1)
    async with far_end(echo) as port, proxy(f"127.0.0.1:{port}", limits=limits) as near:
        _, writer = await near.connect(f"127.0.0.1:{port}")
        assert "all functions have 1" in await near.whole(f"CONNECT 127.0.0.1:{port} HTTP/1.1\r\n\r\n")
        writer.close()


async def test_who_is_silent_is_let_go() -> None:
    limits = dataclasses.replace(LIMITS, function_egress_idle_s=0.05, function_egress_connect_s=0.05)
    async with far_end(echo) as port, proxy(f"127.0.0.1:{port}", limits=limits) as near:
        reader, writer = await near.connect(f"127.0.0.1:{port}")
        assert await reader.read() == b""
        writer.close()
        half, writer = await near.open("CONNECT ")
        assert await half.read() == b""
        writer.close()
        await wait_until_async(lambda: near.egress.connections == 0)


async def test_who_takes_nothing_holds_back_who_sends() -> None:
    sent = 0

    async def flood(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        nonlocal sent
        while True:
            writer.write(bytes(65_536))
            await writer.drain()
            sent += 65_536

    async with far_end(flood) as port:
        limits = dataclasses.replace(LIMITS, function_egress_idle_s=0.5, function_egress_connect_s=0.5)
        async with proxy(f"127.0.0.1:{port}", limits=limits) as near:
            sock = socket.create_connection(("127.0.0.1", near.port))
            sock.sendall(f"CONNECT 127.0.0.1:{port} HTTP/1.1\r\n\r\n".encode())
            with sock:
                # it is broken off in the end; until then no more went than buffers hold
                await wait_until_async(lambda: sent > 0)
                await wait_until_async(lambda: near.egress.connections == 0)
                assert sent < 32 << 20


async def test_the_end_breaks_off_what_is_under_way() -> None:
    async with far_end(echo) as port:
        before = _open_files()
        async with proxy(f"127.0.0.1:{port}") as near:
            open_now = [await near.connect(f"127.0.0.1:{port}") for _ in range(20)]
        for reader, writer in open_now:
            with contextlib.suppress(ConnectionError):
                assert await reader.read() == b""
            writer.close()
        await wait_until_async(lambda: _open_files() <= before)


def _open_files() -> int:
    folder = Path("/proc/self/fd")
    return len(list(folder.iterdir())) if folder.is_dir() else 0


async def test_a_name_server_that_hangs_ends_in_time() -> None:
    async def hang(host: str, port: int) -> Sequence[str]:
        await asyncio.Event().wait()
        return []

    limits = dataclasses.replace(LIMITS, function_egress_connect_s=0.05)
    async with proxy("*", limits=limits) as near:
        near.egress.resolve = hang
        assert (await near.whole("CONNECT slow.example:443 HTTP/1.1\r\n\r\n")).startswith("HTTP/1.1 504 ")


async def test_names_are_looked_up_for_real() -> None:
    egress = Egress()
    try:
        assert "127.0.0.1" in await egress.resolve("localhost", 80)
    finally:
        egress.close()
