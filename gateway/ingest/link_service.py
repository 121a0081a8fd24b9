"""The gRPC shell of the link: one bidirectional stream is one lane."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator

import grpc

from gateway.errors import LinkError, ProtocolError
from gateway.ingest.links import Lane, Links
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.errors import ConfigError
from metaros.limits import LIMITS, Limits

__all__ = ["LinkService", "make_server"]

log = logging.getLogger(__name__)

HELLO_S = 10.0
LAST_WORDS_S = 1.0  # how long a closed lane may take to write its Goodbye

Context = grpc.aio.ServicerContext[link_pb2.AgentFrame, link_pb2.GatewayFrame]


class LinkService(link_pb2_grpc.LinkServicer):
    """Carries frames between gRPC and `Links`."""

    def __init__(self, links: Links) -> None:
        self._links = links

    async def Connect(self, request_iterator: AsyncIterator[link_pb2.AgentFrame], context: Context) -> None:
        """One lane from Hello to the end of its connection."""
        frames = aiter(request_iterator)
        try:
            async with asyncio.timeout(HELLO_S):
                first = await anext(frames)
            if first.WhichOneof("frame") != "hello":
                raise ProtocolError("the first frame of a lane is its Hello")
            lane = await self._links.join(first.hello)
        except LinkError as error:
            log.warning("a link was refused: %s", error)
            goodbye = link_pb2.Goodbye(code=error.code, message=str(error)[:1024], retry_after_ms=1000)
            await context.write(link_pb2.GatewayFrame(goodbye=goodbye))
            return
        except (TimeoutError, StopAsyncIteration):
            return
        await self._serve(lane, frames, context)

    async def _serve(self, lane: Lane, frames: AsyncIterator[link_pb2.AgentFrame], context: Context) -> None:
        reader = asyncio.create_task(self._read(lane, frames))
        writer = asyncio.create_task(self._write(lane, context))
        try:
            await asyncio.wait({reader, writer}, return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._links.ended(lane)
            lane.outbox.close()
            reader.cancel()
            await asyncio.wait({writer}, timeout=LAST_WORDS_S)
            writer.cancel()
            await asyncio.gather(reader, writer, return_exceptions=True)

    async def _read(self, lane: Lane, frames: AsyncIterator[link_pb2.AgentFrame]) -> None:
        async for frame in frames:
            await self._links.receive(lane, frame)

    @staticmethod
    async def _write(lane: Lane, context: Context) -> None:
        while (frame := await lane.outbox.next()) is not None:
            await context.write(frame)


def make_server(links: Links, *, host: str, port: int, limits: Limits = LIMITS) -> tuple[grpc.aio.Server, int]:
    """A gRPC server bound to a port (0: any) that no other process shares; ConfigError when it is taken."""
    server = grpc.aio.server(
        options=[
            ("grpc.so_reuseport", 0),
            ("grpc.max_receive_message_length", limits.frame_bytes),
            ("grpc.max_send_message_length", limits.frame_bytes),
            ("grpc.keepalive_time_ms", 10_000),
            ("grpc.keepalive_timeout_ms", 5_000),
            # Agents ping every heartbeat: that must never look like a flood, whatever the jitter.
            ("grpc.http2.min_ping_interval_without_data_ms", 1_000),
            ("grpc.http2.max_ping_strikes", 0),
        ]
    )
    link_pb2_grpc.add_LinkServicer_to_server(LinkService(links), server)
    try:
        bound = server.add_insecure_port(f"[{host}]:{port}" if ":" in host else f"{host}:{port}")
    except RuntimeError as error:
        raise ConfigError(f"port {port} for robots cannot be opened: {error}") from error
    return server, bound
