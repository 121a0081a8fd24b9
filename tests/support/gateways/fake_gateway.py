"""A real gRPC server in process around the small gateway half: what an agent's tests connect to."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any

import grpc
import grpc.aio

from metaros._proto import link_pb2, link_pb2_grpc
from tests.support.gateways.gateway_half import BACKFILL, CONTROL, DATA, LANES, GatewayHalf
from tests.support.ports import free_port

OPTIONS = (
    ("grpc.so_reuseport", 0),
    ("grpc.http2.min_ping_interval_without_data_ms", 1000),
    ("grpc.http2.max_ping_strikes", 0),
)


class FakeGateway(link_pb2_grpc.LinkServicer):
    """One robot's link: every frame goes to `half`, whatever `half` wants to say goes out; acks at once."""

    def __init__(self, half: GatewayHalf | None = None) -> None:
        self.half = half or GatewayHalf()
        self.port = free_port()
        self.sessions = 0
        self.acks = True
        self._out: dict[int, asyncio.Queue[link_pb2.GatewayFrame]] = {}
        self._server: grpc.aio.Server | None = None

    @property
    def target(self) -> str:
        """Where to connect."""
        return f"127.0.0.1:{self.port}"

    async def start(self) -> None:
        """Listen; the port stays the same over restarts."""
        self._server = grpc.aio.server(options=OPTIONS)
        link_pb2_grpc.add_LinkServicer_to_server(self, self._server)
        assert self._server.add_insecure_port(self.target) == self.port
        await self._server.start()

    async def stop(self) -> None:
        """Cut every stream and stop listening."""
        assert self._server is not None
        await self._server.stop(0)
        self._out.clear()

    def say(self, frame: link_pb2.GatewayFrame, *, lane: int = CONTROL) -> None:
        """Send a frame to the agent."""
        self._out[lane].put_nowait(frame)

    @property
    def connected(self) -> bool:
        """Whether all lanes are open."""
        return len(self._out) == len(LANES)

    async def Connect(self, request: AsyncIterator[link_pb2.AgentFrame], context: Any) -> None:
        """One lane."""
        lane = 0
        sender: asyncio.Task[None] | None = None
        try:
            async for frame in request:
                if frame.HasField("hello"):
                    lane = frame.hello.lane
                    if lane == CONTROL:
                        self.half.connect()
                        self.sessions += 1
                    self._out[lane] = asyncio.Queue()
                    sender = asyncio.create_task(self._send(self._out[lane], context))
                self.half.receive(lane, frame)
                if self.acks:
                    self.half.ack()
                self._flush()
        finally:
            if sender is not None:
                sender.cancel()

    def _flush(self) -> None:
        for lane, frames in self.half.out.items():
            while frames and lane in self._out:
                self._out[lane].put_nowait(frames.pop(0))

    async def _send(self, queue: asyncio.Queue[link_pb2.GatewayFrame], context: Any) -> None:
        while True:
            await context.write(await queue.get())


@asynccontextmanager
async def fake_gateway(half: GatewayHalf | None = None) -> AsyncIterator[FakeGateway]:
    """A listening FakeGateway."""
    gateway = FakeGateway(half)
    await gateway.start()
    try:
        yield gateway
    finally:
        await gateway.stop()


__all__ = ["BACKFILL", "CONTROL", "DATA", "FakeGateway", "fake_gateway"]
