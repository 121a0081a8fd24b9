"""The fake gateway behind a WebSocket: the same frames by the other transport."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from metaros._proto import link_pb2
from tests.support.gateways.fake_gateway import FakeGateway
from tests.support.gateways.gateway_half import GatewayHalf

__all__ = ["WebSocketGateway", "websocket_gateway"]

SUBPROTOCOL = "metaros.link.v1"


class WebSocketGateway(FakeGateway):
    """Listens for WebSockets instead of gRPC."""

    def __init__(self, half: GatewayHalf | None = None, *, subprotocol: str = SUBPROTOCOL, ssl: Any = None) -> None:
        super().__init__(half)
        self.paths: list[str] = []
        self.received_bytes = 0
        self._subprotocol: Any = subprotocol
        self._ssl = ssl
        self._listener: Server | None = None

    async def start(self) -> None:
        """Listen; the port stays the same over restarts."""
        self._listener = await serve(
            self._lane,
            "127.0.0.1",
            self.port,
            subprotocols=[self._subprotocol],
            ssl=self._ssl,
            compression=None,
            max_size=None,
        )

    async def stop(self) -> None:
        """Cut every lane and stop listening."""
        assert self._listener is not None
        for socket in list(self._listener.connections):
            socket.transport.abort()
        self._listener.close()
        await self._listener.wait_closed()
        self._out.clear()

    async def _lane(self, socket: ServerConnection) -> None:
        assert socket.request is not None
        assert socket.request.headers.get("Origin") is None
        self.paths.append(socket.request.path)
        try:
            await self.Connect(self._frames(socket), Context(socket.send))
        except ConnectionClosed:
            return

    async def _frames(self, socket: ServerConnection) -> AsyncIterator[link_pb2.AgentFrame]:
        async for message in socket:
            assert isinstance(message, bytes)
            self.received_bytes += len(message)
            yield link_pb2.AgentFrame.FromString(message)


class Context:
    """What the fake needs of a gRPC context."""

    def __init__(self, send: Callable[[bytes], Any]) -> None:
        self._send = send

    async def write(self, frame: link_pb2.GatewayFrame) -> None:
        """Send a frame."""
        await self._send(frame.SerializeToString())


@asynccontextmanager
async def websocket_gateway(half: GatewayHalf | None = None, **options: Any) -> AsyncIterator[WebSocketGateway]:
    """A listening WebSocketGateway."""
    gateway = WebSocketGateway(half, **options)
    await gateway.start()
    try:
        yield gateway
    finally:
        await gateway.stop()
