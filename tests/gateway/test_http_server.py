"""A socket that is refused, or whose other end has gone, is no failure of the server: it fills nobody's log."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Sequence
from pathlib import Path

import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin

from gateway.domain.principal import Principal, Role
from gateway.main import Ready
from tests.gateway.harness import client, running_gateway
from tests.support.key_ring import KeyRing, bearer
from tests.support.waiting import wait_until_async

STREAM = "/api/v1/stream"


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


def head(ready: Ready, *more: str) -> bytes:
    """The request of a socket."""
    lines = [
        f"GET {STREAM} HTTP/1.1",
        f"Host: 127.0.0.1:{ready.http_port}",
        "Connection: Upgrade",
        "Upgrade: websocket",
        "Sec-WebSocket-Version: 13",
        "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        *more,
    ]
    return "\r\n".join([*lines, "", ""]).encode()


@pytest.mark.parametrize(
    ("path", "key", "origin", "status"),
    [
        (STREAM, "", "", 401),
        (STREAM, "mrk_1_2", "", 401),
        (STREAM, "", "https://other.example", 403),
        ("/api/v1/nothing", "", "", 403),
        ("/api/v1/robots/sim_1/teleop", "", "", 401),
    ],
)
async def test_a_refused_socket_says_nothing_in_the_log(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, path: str, key: str, origin: str, status: int
) -> None:
    async with running_gateway(tmp_path, anonymous=False) as ready:
        said = Origin(origin or ready.url)
        url = ready.url.replace("http", "ws", 1) + path
        with pytest.raises(InvalidStatus) as refused:
            async with connect(url, origin=said, proxy=None, additional_headers=bearer(key)):
                pass
        assert refused.value.response.status_code == status
        async with client(ready, key="") as http:  # the socket's task is over by then
            assert (await http.get("/healthz")).status_code == 200
    assert complaints(caplog.records) == []


@pytest.mark.parametrize("good", [True, False])
async def test_who_leaves_in_the_middle_of_a_handshake_says_nothing_either(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, good: bool
) -> None:
    ring = SlowRing()
    key = ring.add(role=Role.VIEWER) if good else "mrk_1_2"
    async with running_gateway(tmp_path, door=ring) as ready, client(ready, key="") as http:
        _, writer = await asyncio.open_connection("127.0.0.1", ready.http_port)
        writer.write(head(ready, f"Authorization: Bearer {key}"))
        await wait_until_async(lambda: ring.asked == 1)
        writer.transport.abort()
        for _ in range(3):  # the server has seen that by then
            assert (await http.get("/healthz")).status_code == 200
        ring.go.set()
        assert (await http.get("/healthz")).status_code == 200
    assert complaints(caplog.records) == []
