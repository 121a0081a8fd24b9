"""The gRPC shell of the link: one bidirectional stream is one lane."""

from __future__ import annotations

from collections.abc import AsyncIterator

import grpc

from gateway.ingest.lane_shell import serve_lane
from gateway.ingest.links import Links
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.errors import ConfigError
from metaros.limits import LIMITS, Limits

__all__ = ["LinkService", "make_server"]

Context = grpc.aio.ServicerContext[link_pb2.AgentFrame, link_pb2.GatewayFrame]


class LinkService(link_pb2_grpc.LinkServicer):
    """Carries frames between gRPC and `Links`."""

    def __init__(self, links: Links) -> None:
        self._links = links

    async def Connect(self, request_iterator: AsyncIterator[link_pb2.AgentFrame], context: Context) -> None:
        """One lane from Hello to the end of its connection."""
        frames = aiter(request_iterator)
        await serve_lane(self._links, lambda: anext(frames, None), context.write)


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
