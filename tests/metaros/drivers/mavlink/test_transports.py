"""A vehicle's TCP wire: quiet is nothing, an end is an error."""

from __future__ import annotations

import socket
from typing import Any

import pytest

from metaros.drivers.mavlink import transports
from metaros.drivers.mavlink.transports import open_transport
from metaros.errors import UnavailableError


class FakeContext:
    """Hands on what is heard, and knows what it was."""

    def __init__(self) -> None:
        self.all: list[bytes] = []

    def heard(self, data: bytes) -> bytes:
        self.all.append(data)
        return data


def test_a_quiet_tcp_link_gives_nothing_and_one_that_ends_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(transports, "READ_S", 0.0)
    context: Any = FakeContext()
    with socket.create_server(("127.0.0.1", 0)) as server:
        transport = open_transport(context, f"tcp:127.0.0.1:{server.getsockname()[1]}", 0)
        vehicle, _ = server.accept()
    try:
        assert transport.read() == b""
        assert context.all == []
        monkeypatch.setattr(transports, "READ_S", 60.0)
        vehicle.sendall(b"beat")
        assert transport.read() == b"beat"
        vehicle.close()
        with pytest.raises(UnavailableError, match="the other end closed"):
            transport.read()
        assert context.all == [b"beat"]
    finally:
        transport.close()
