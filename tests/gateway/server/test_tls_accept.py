"""The TLS port's accepting side, on both event loops: nobody's first bytes are lost, and nobody holds a place."""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections.abc import AsyncIterator, Callable
from contextlib import ExitStack, asynccontextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from cryptography.hazmat.primitives.serialization import Encoding

from gateway.identity.certificates.ca import issue_server, make_intermediate, make_root
from gateway.main import new_event_loop
from gateway.server.connections import Connection, ConnectionLimits
from gateway.server.ports import listen
from gateway.server.tls import HttpTls
from gateway.server.tls_accept import TlsAcceptor
from metaros.clock import SystemClock
from metaros.limits import LIMITS

CLOCK = SystemClock()
LOOPS = pytest.mark.parametrize("loop", [asyncio.new_event_loop, new_event_loop], ids=["asyncio", "uvloop"])


class Echo(asyncio.Protocol):
    """Sends back what comes, once; counted as HTTP is."""

    def __init__(self, connection_limits: ConnectionLimits, connection: Connection) -> None:
        self._connection_limits = connection_limits
        self._connection = connection

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport: asyncio.Transport = transport  # type: ignore[assignment]
        self._connection_limits.secured(self._connection, self._transport)

    def data_received(self, data: bytes) -> None:
        self._transport.write(data)
        self._transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self._connection_limits.remove(self._connection)


@asynccontextmanager
async def port(folder: Path, *, head_s: float = 60.0) -> AsyncIterator[tuple[int, ConnectionLimits, ssl.SSLContext]]:
    """A TLS port that echoes; its number, its connection limits and whom to trust."""
    now_ns = CLOCK.wall_ns()
    root, key = make_root("test", now_ns=now_ns)
    pair = issue_server(make_intermediate("test", root, key, now_ns=now_ns), ["localhost"], now_ns=now_ns)
    connection_limits = ConnectionLimits(clock=CLOCK, limits=replace(LIMITS, head_s=head_s), is_shared=lambda _: True)
    listener = listen("127.0.0.1", 0, default=0, flag="--port")
    tls = HttpTls(lambda: pair, folder=folder)
    acceptor = TlsAcceptor(
        listener,
        connection_limits=connection_limits,
        context=tls.context,
        protocol=lambda connection: Echo(connection_limits, connection),
    )
    task = asyncio.get_running_loop().create_task(acceptor.run())
    trust = ssl.create_default_context(cadata=root.public_bytes(Encoding.PEM).decode())
    try:
        yield listener.getsockname()[1], connection_limits, trust
    finally:
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)
        connection_limits.close()
        listener.close()


async def empty(connection_limits: ConnectionLimits) -> None:
    """Everybody is gone."""
    async with asyncio.timeout(60):
        while len(connection_limits):  # noqa: ASYNC110  (nothing tells)
            await asyncio.sleep(0.01)


def dial(number: int) -> socket.socket:
    """A connection that has said nothing; blocking, as clients live on threads here."""
    return socket.create_connection(("127.0.0.1", number), 60)


def echoed(number: int, trust: ssl.SSLContext) -> bytes:
    """One connection's answer."""
    with dial(number) as raw, trust.wrap_socket(raw, server_hostname="localhost") as tls:
        tls.sendall(b"hello")
        return tls.recv(64)


def run(loop: Callable[[], asyncio.AbstractEventLoop], test: object) -> None:
    """Run a test's coroutine on that loop."""
    with asyncio.Runner(loop_factory=loop) as runner:
        runner.run(test)  # type: ignore[arg-type]


@LOOPS
def test_many_at_once_all_get_their_answer(tmp_path: Path, loop: Callable[[], asyncio.AbstractEventLoop]) -> None:
    async def test() -> None:
        async with port(tmp_path) as (number, connection_limits, trust):
            answers = await asyncio.gather(*(asyncio.to_thread(echoed, number, trust) for _ in range(40)))
            assert answers == [b"hello"] * 40
            await empty(connection_limits)

    run(loop, test())


@LOOPS
def test_who_says_nothing_or_no_tls_is_gone(tmp_path: Path, loop: Callable[[], asyncio.AbstractEventLoop]) -> None:
    async def test() -> None:
        async with port(tmp_path, head_s=0.3) as (number, connection_limits, _):
            with ExitStack() as dialled:
                silent, half, plain = (dialled.enter_context(dial(number)) for _ in range(3))
                half.sendall(b"\x16\x03\x01")
                plain.sendall(b"GET / HTTP/1.1\r\n\r\n")
                assert (await asyncio.to_thread(plain.recv, 64)).startswith(b"HTTP/1.1 400 ")
                assert await asyncio.to_thread(silent.recv, 64) == b""
                assert await asyncio.to_thread(half.recv, 64) == b""
                await empty(connection_limits)

    run(loop, test())


@LOOPS
def test_an_end_in_the_middle_of_a_handshake(tmp_path: Path, loop: Callable[[], asyncio.AbstractEventLoop]) -> None:
    async def test() -> None:
        async with port(tmp_path) as (number, connection_limits, trust):
            for said in (b"", b"\x16", b"\x16\x03\x01\x02"):
                with dial(number) as gone:
                    gone.sendall(said)
            assert await asyncio.to_thread(echoed, number, trust) == b"hello"
            await empty(connection_limits)

    run(loop, test())
