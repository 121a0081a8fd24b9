"""How a gRPC port is opened: a real server, to whose first attempts somebody else is quicker."""

from __future__ import annotations

import asyncio
import socket
import ssl
from collections.abc import Callable, Iterator
from pathlib import Path

import grpc
import pytest

from gateway.server.grpc import ANY_PORT_TRIES, ServerTls, make_server
from metaros.errors import ConfigError
from tests.support.servers.certificates import make_certificate

Tls = Callable[[], ServerTls] | None
REAL_SERVER = grpc.aio.server


class LateServer:
    """gRPC's own, whose port is another's between choice and bind, so many times."""

    def __init__(self, server: grpc.aio.Server, taken: str, lost: int) -> None:
        self.server, self.taken, self.lost = server, taken, lost

    def add_insecure_port(self, address: str) -> int:
        return self.server.add_insecure_port(self._place(address))

    def add_secure_port(self, address: str, credentials: grpc.ServerCredentials) -> int:
        return self.server.add_secure_port(self._place(address), credentials)

    def _place(self, address: str) -> str:
        self.lost -= 1
        return self.taken if self.lost >= 0 else address


@pytest.fixture
def taken() -> Iterator[int]:
    """A port that somebody has."""
    with socket.create_server(("127.0.0.1", 0)) as other:
        yield other.getsockname()[1]


@pytest.fixture(params=["plain", "tls"])
def tls(request: pytest.FixtureRequest, tmp_path: Path) -> Tls:
    if request.param == "plain":
        return None
    certificate = make_certificate(tmp_path)
    shown = ServerTls(((certificate.read_bytes(), certificate.with_suffix(".key").read_bytes()),))
    return lambda: shown


def opened(tls: Tls, port: int = 0) -> tuple[grpc.aio.Server, int]:
    return make_server(lambda _: None, host="127.0.0.1", port=port, connections=8, tls=tls)


async def answers(server: grpc.aio.Server, port: int, folder: Path, *, tls: bool) -> bool:
    """Whether it is connected to, by TLS where it has that."""
    trust = ssl.create_default_context(cafile=folder / "localhost.pem") if tls else None
    if trust is not None:
        trust.set_alpn_protocols(["h2"])
    await server.start()
    try:
        async with asyncio.timeout(60):
            _, writer = await asyncio.open_connection(
                "127.0.0.1", port, ssl=trust, server_hostname="localhost" if tls else None
            )
        writer.close()
        return True
    finally:
        await server.stop(None)


async def test_any_port_is_looked_for_again(
    monkeypatch: pytest.MonkeyPatch, taken: int, tls: Tls, tmp_path: Path
) -> None:
    late = LateServer(REAL_SERVER(options=[("grpc.so_reuseport", 0)]), f"127.0.0.1:{taken}", ANY_PORT_TRIES - 1)
    monkeypatch.setattr(grpc.aio, "server", lambda **_: late)
    _, port = opened(tls)
    assert port not in (0, taken)
    assert await answers(late.server, port, tmp_path, tls=tls is not None)


async def test_it_is_not_looked_for_for_ever(monkeypatch: pytest.MonkeyPatch, taken: int, tls: Tls) -> None:
    late = LateServer(REAL_SERVER(options=[("grpc.so_reuseport", 0)]), f"127.0.0.1:{taken}", ANY_PORT_TRIES)
    monkeypatch.setattr(grpc.aio, "server", lambda **_: late)
    with pytest.raises(ConfigError, match="port 0 cannot be opened"):
        opened(tls)


async def test_a_port_that_was_asked_for_and_is_taken_is_refused(taken: int, tls: Tls, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=f"port {taken} cannot be opened"):
        opened(tls, taken)
    server, port = opened(tls)  # as a default one moves
    assert await answers(server, port, tmp_path, tls=tls is not None)
