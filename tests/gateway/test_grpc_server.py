"""How a gRPC port is opened."""

from __future__ import annotations

import grpc
import pytest

from gateway.grpc_server import ANY_PORT_TRIES, make_server
from metaros.errors import ConfigError


class LateServer:
    """A server whose port somebody else takes between gRPC's choice and its bind, so many times."""

    def __init__(self, lost: int) -> None:
        self.lost = lost

    def add_insecure_port(self, address: str) -> int:
        self.lost -= 1
        if self.lost >= 0:
            raise RuntimeError(f"Failed to bind to address {address}")
        return 4711


@pytest.mark.parametrize(("port", "lost"), [(0, ANY_PORT_TRIES - 1), (8443, 0)])
def test_any_port_is_looked_for_again(monkeypatch: pytest.MonkeyPatch, port: int, lost: int) -> None:
    monkeypatch.setattr(grpc.aio, "server", lambda **_: LateServer(lost))
    assert make_server(lambda _: None, host="0.0.0.0", port=port, connections=1)[1] == 4711


@pytest.mark.parametrize(("port", "lost"), [(0, ANY_PORT_TRIES), (8443, 1)])
def test_a_port_that_is_taken_is_refused(monkeypatch: pytest.MonkeyPatch, port: int, lost: int) -> None:
    monkeypatch.setattr(grpc.aio, "server", lambda **_: LateServer(lost))
    with pytest.raises(ConfigError, match=f"port {port} cannot be opened"):
        make_server(lambda _: None, host="0.0.0.0", port=port, connections=1)
