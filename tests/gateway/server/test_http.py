"""A socket that is refused, or whose other end goes, is no failure of the server, and nobody waits for it any more."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import uvicorn
from starlette.websockets import WebSocket, WebSocketDisconnect
from uvicorn.server import ServerState
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin

from gateway.api.middleware.guard import PROTOCOL_KEY
from gateway.api.ws.send_queue import BINARY, SendQueue, frame
from gateway.domain.principal import Principal, Role
from gateway.server.connections import ConnectionLimits
from gateway.server.http import protocols
from metaros.clock import SystemClock
from tests.gateway.harness import client, running_gateway
from tests.support.gateways.memory_authenticator import KeyRing, bearer
from tests.support.waiting import wait_until_async

STREAM = "/api/v1/stream"
GO_AWAY = b"\x88\x82" + bytes(4) + (1001).to_bytes(2, "big")  # a client's close frame, under a mask of zeros


class SlowRing(KeyRing):
    """Says whose key it is when the test says so."""

    def __init__(self) -> None:
        super().__init__()
        self.asked = 0
        self.go = asyncio.Event()

    async def by_key(self, text: str) -> Principal | None:
        """After a while."""
        self.asked += 1
        await self.go.wait()
        return await super().by_key(text)


def complaints(records: Sequence[logging.LogRecord]) -> list[str]:
    """What is said in a log as the gateway's command keeps it."""
    return [f"{record.name}: {record.getMessage()}" for record in records if record.levelno >= logging.WARNING]


def head(port: int, *more: str) -> bytes:
    """The request of a socket."""
    lines = [
        f"GET {STREAM} HTTP/1.1",
        f"Host: 127.0.0.1:{port}",
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        *more,
    ]
    return "\r\n".join([*lines, "", ""]).encode()


REFUSED = [
    (STREAM, "", "", 401),
    (STREAM, "mrk_1_2", "", 401),
    (STREAM, "", "https://other.example", 403),
    ("/api/v1/nothing", "", "", 403),
    ("/api/v1/robots/sim_1/teleop", "", "", 401),
]


async def test_a_refused_socket_says_nothing_in_the_log(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    found = []
    async with running_gateway(tmp_path, anonymous=False) as ready, client(ready, key="") as http:
        for path, key, origin, _ in REFUSED:
            url, said = ready.url.replace("http", "ws", 1) + path, Origin(origin or ready.url)
            with pytest.raises(InvalidStatus) as refused:
                async with connect(url, origin=said, proxy=None, additional_headers=bearer(key)):
                    pass
            assert (await http.get("/healthz")).status_code == 200  # the socket's task is over by then
            found.append((path, key, origin, refused.value.response.status_code))
    assert found == REFUSED
    assert complaints(caplog.records) == []


async def test_who_leaves_in_the_middle_of_a_handshake_says_nothing_either(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    ring = SlowRing()
    async with running_gateway(tmp_path, authenticator=ring) as ready, client(ready, key="") as http:
        for number, key in enumerate((ring.add(role=Role.VIEWER), "mrk_1_2"), 1):
            ring.go.clear()
            _, writer = await asyncio.open_connection("127.0.0.1", ready.http_port)
            writer.write(head(ready.http_port, f"Authorization: Bearer {key}"))
            await wait_until_async(lambda number=number: ring.asked == number)
            writer.transport.abort()
            for _ in range(3):  # the server has seen that by then
                assert (await http.get("/healthz")).status_code == 200
            ring.go.set()
            assert (await http.get("/healthz")).status_code == 200
    assert complaints(caplog.records) == []


class Flood:
    """An application that sends for as long as its one client takes something."""

    def __init__(self, *, queued: bool) -> None:
        self.protocol: Any = None
        self.over = asyncio.Event()
        self._queued = queued

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """ASGI."""
        if scope["type"] != "websocket":
            return
        self.protocol = scope[PROTOCOL_KEY]
        socket = WebSocket(scope, receive, send)
        await socket.accept()
        await (self._through_queue(socket) if self._queued else self._through_asgi(socket))
        self.over.set()

    async def _through_asgi(self, socket: WebSocket) -> None:
        with suppress(WebSocketDisconnect):
            while True:
                await socket.send_bytes(bytes(1 << 16))

    async def _through_queue(self, socket: WebSocket) -> None:
        queue = SendQueue(socket, clock=SystemClock(), stall_s=600)
        while queue.ready():
            queue.write(frame(BINARY, bytes(1 << 16)))
            await queue.drain()
        queue.close()

    @property
    def waits(self) -> bool:
        """Whether its client takes nothing."""
        return self.protocol is not None and not self.protocol.writable.is_set()


@asynccontextmanager
async def served(app: Flood) -> AsyncIterator[int]:
    """The port of an application behind the gateway's protocols, without anybody who cuts the late."""
    http, ws = protocols(ConnectionLimits(clock=SystemClock()), clock=SystemClock())
    config = uvicorn.Config(app, http=http, ws=ws, lifespan="off", log_config=None)
    config.load()
    state = ServerState()

    def connection() -> Any:
        return config.http_protocol_class(config=config, server_state=state, app_state={})

    server = await asyncio.get_running_loop().create_server(connection, "127.0.0.1", 0)
    async with server:
        yield server.sockets[0].getsockname()[1]
        for protocol in list(state.connections):
            protocol.transport.abort()
        await wait_until_async(lambda: not state.connections and not state.tasks)


@pytest.mark.parametrize("queued", [False, True], ids=["asgi", "queue"])
async def test_who_sends_to_a_client_that_takes_nothing_is_reported_when_it_closes(queued: bool) -> None:
    app = Flood(queued=queued)
    async with served(app) as port, asyncio.timeout(60):
        _, writer = await asyncio.open_connection("127.0.0.1", port, limit=1024)
        try:
            writer.write(head(port))
            await wait_until_async(lambda: app.waits)
            assert not app.over.is_set()
            writer.write(GO_AWAY)
            await app.over.wait()
        finally:
            writer.transport.abort()
