"""Lanes over grpc.aio, as the agent has them, and over a WebSocket: the other choices of `--transport`."""

from __future__ import annotations

import asyncio
from typing import Any

from websockets.client import ClientProtocol
from websockets.frames import Opcode
from websockets.protocol import State
from websockets.uri import parse_uri

from edge_agent.config.gateway_address import parse_address
from edge_agent.errors import LinkError
from edge_agent.uplink.grpc import GrpcConnection, open_grpc
from edge_agent.uplink.websocket import SUBPROTOCOL
from load_tests.fleet.lanes import LaneCallbacks, Traffic
from metaros.limits import LIMITS

__all__ = ["AioLane", "WebSocketLane", "open_aio", "open_websocket"]


class AioLane:
    """The agent's own gRPC connection, with the two tasks that the agent gives it."""

    def __init__(self, connection: GrpcConnection, callbacks: LaneCallbacks, traffic: Traffic) -> None:
        self._connection, self._callbacks, self._traffic = connection, callbacks, traffic
        self._frames: asyncio.Queue[bytes] = asyncio.Queue()
        self._writing = False
        self._tasks = [asyncio.create_task(self._read()), asyncio.create_task(self._write())]
        self._open = True

    @property
    def full(self) -> bool:
        """Whether a write is under way."""
        return self._writing or not self._frames.empty()

    def write(self, frame: bytes) -> None:
        """Hand it to the writer."""
        self._traffic.sent_frames += 1
        self._traffic.sent_bytes += len(frame)
        self._frames.put_nowait(frame)

    def ping(self) -> None:
        """gRPC does that."""

    def close(self) -> None:
        """Cancel all."""
        if self._open:
            self._open = False
            for task in self._tasks:
                task.cancel()
            self._tasks = [asyncio.create_task(self._connection.close())]

    async def _read(self) -> None:
        try:
            while True:
                frame = await self._connection.read()
                self._traffic.received_frames += 1
                data = frame.SerializeToString()
                self._traffic.received_bytes += len(data)
                self._callbacks.frame(data)
        except LinkError as error:
            self._end(str(error))

    async def _write(self) -> None:
        try:
            while True:
                frame = await self._frames.get()
                self._writing = True
                await self._connection.write(frame)
                self._writing = False
                if self._frames.empty() and self._open:
                    self._callbacks.room()
        except LinkError as error:
            self._end(str(error))

    def _end(self, why: str) -> None:
        if self._open:
            asyncio.get_running_loop().call_soon(self.close)
            self._callbacks.over(why.partition(":")[0])


async def open_aio(host: str, port: int, callbacks: LaneCallbacks, traffic: Traffic) -> AioLane:
    """Start a lane's stream."""
    return AioLane(await open_grpc(parse_address(f"{host}:{port}")), callbacks, traffic)


class WebSocketLane(asyncio.Protocol):
    """websockets' own state machine on a bare socket."""

    def __init__(self, url: str, callbacks: LaneCallbacks, traffic: Traffic) -> None:
        self._callbacks, self._traffic = callbacks, traffic
        self._protocol = ClientProtocol(parse_uri(url), subprotocols=[SUBPROTOCOL], max_size=LIMITS.frame_bytes)
        self._transport: Any = None
        self._paused = False
        self._open = True
        self.upgraded = asyncio.get_running_loop().create_future()

    @property
    def full(self) -> bool:
        """Whether the socket takes no more."""
        return self._paused

    def write(self, frame: bytes) -> None:
        """One binary message."""
        if self._open:
            self._traffic.sent_frames += 1
            self._protocol.send_binary(frame)
            self._send()

    def ping(self) -> None:
        """As the agent does."""
        if self._open and self._protocol.state is State.OPEN:
            self._protocol.send_ping(b"")
            self._send()

    def close(self) -> None:
        """Cut it; nobody is told."""
        self._open = False
        if self._transport is not None:
            self._transport.abort()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Ask for the upgrade."""
        self._transport = transport
        self._protocol.send_request(self._protocol.connect())
        self._send()

    def data_received(self, data: bytes) -> None:
        """The answer to the upgrade, then messages."""
        self._traffic.received_bytes += len(data)
        self._protocol.receive_data(data)
        self._send()
        for event in self._protocol.events_received():
            if not self.upgraded.done():
                refused = self._protocol.handshake_exc
                if refused is not None:
                    self._end(str(refused))
                    return
                self.upgraded.set_result(None)
            elif getattr(event, "opcode", None) is Opcode.BINARY and self._open:
                self._traffic.received_frames += 1
                self._callbacks.frame(bytes(event.data))  # type: ignore[union-attr]
        if self._open and self._protocol.state in (State.CLOSING, State.CLOSED):
            self._end("the gateway closed the socket")

    def connection_lost(self, exc: Exception | None) -> None:
        """It went."""
        self._end(str(exc) if exc else "the connection broke")

    def pause_writing(self) -> None:
        """The socket takes no more."""
        self._paused = True

    def resume_writing(self) -> None:
        """It does again."""
        self._paused = False
        if self._open:
            self._callbacks.room()

    def _send(self) -> None:
        for data in self._protocol.data_to_send():
            if data:
                self._traffic.sent_bytes += len(data)
                self._transport.write(data)

    def _end(self, why: str) -> None:
        if not self.upgraded.done():
            self.upgraded.set_exception(ConnectionError(why))
        if self._open:
            self.close()
            self._callbacks.over(why)


async def open_websocket(host: str, port: int, callbacks: LaneCallbacks, traffic: Traffic) -> WebSocketLane:
    """Connect a lane and upgrade it. Raises OSError."""
    loop, url = asyncio.get_running_loop(), f"ws://{host}:{port}/api/v1/link"
    _, lane = await loop.create_connection(lambda: WebSocketLane(url, callbacks, traffic), host, port)
    await lane.upgraded
    return lane
