"""A lane over gRPC: one channel and one bidirectional stream, so that control never waits behind data."""

from __future__ import annotations

import asyncio
import functools
import ssl
from pathlib import Path
from typing import Any

import grpc
import grpc.aio

from edge_agent.config.gateway_address import GatewayAddress
from edge_agent.errors import LinkError
from edge_agent.identity.credentials import Credentials
from edge_agent.uplink.transport import DEAD_PATH_S, gateway_frame
from metaros._proto import link_pb2
from metaros.limits import LIMITS

__all__ = ["GrpcConnection", "open_grpc"]

OPTIONS = (
    ("grpc.use_local_subchannel_pool", 1),  # a connection of its own for each lane
    ("grpc.enable_retries", 0),
    ("grpc.keepalive_time_ms", round(LIMITS.heartbeat_s * 1000)),
    ("grpc.keepalive_timeout_ms", round(DEAD_PATH_S * 1000)),  # on Linux also TCP_USER_TIMEOUT
    ("grpc.http2.max_pings_without_data", 0),
    ("grpc.max_receive_message_length", LIMITS.frame_bytes),
    ("grpc.max_send_message_length", LIMITS.frame_bytes),
)


async def open_grpc(address: GatewayAddress, *, shown: Credentials | None = None) -> GrpcConnection:
    """Start a lane's stream; a gateway that is not there shows with the first write or read.

    With `shown`, TLS has the robot's certificate and trusts the fleet's root; without, the system's authorities.
    """
    if address.tls:
        channel = grpc.aio.secure_channel(address.authority, channel_credentials(shown), options=OPTIONS)
    else:
        channel = grpc.aio.insecure_channel(address.authority, options=OPTIONS)
    return GrpcConnection(channel)


class GrpcConnection:
    """One `Link.Connect`. Frames go out as they are: most of them were packed when they were accepted."""

    def __init__(self, channel: grpc.aio.Channel) -> None:
        self._channel = channel
        self._call: Any = channel.stream_stream("/metaros.v1.Link/Connect", request_serializer=bytes)()

    async def write(self, frame: bytes) -> None:
        """Write a frame; HTTP/2 flow control makes it wait."""
        try:
            await self._call.write(frame)
        except grpc.aio.AioRpcError as error:
            raise LinkError(describe(error)) from error
        except asyncio.InvalidStateError as error:
            raise LinkError("the stream ended") from error

    async def read(self) -> link_pb2.GatewayFrame:
        """The next frame."""
        try:
            data = await self._call.read()
        except grpc.aio.AioRpcError as error:
            raise LinkError(describe(error)) from error
        if data is grpc.aio.EOF:
            raise LinkError("the gateway ended the stream")
        return gateway_frame(data)

    async def close(self) -> None:
        """Cancel the stream and end the channel."""
        self._call.cancel()
        await self._channel.close()


def channel_credentials(shown: Credentials | None) -> grpc.ChannelCredentials:
    """What TLS shows and trusts."""
    if shown is None:
        return grpc.ssl_channel_credentials(system_roots())
    key, chain = shown.key_and_chain()
    return grpc.ssl_channel_credentials(shown.roots(system_roots()), key, chain)


def describe(error: grpc.aio.AioRpcError) -> str:
    """One line about a failed call."""
    return f"{error.code().name.lower()}: {error.details()}"


@functools.cache
def system_roots() -> bytes | None:
    """The certificates that this system trusts, as PEM; None = gRPC's own list, where the system has none."""
    paths = ssl.get_default_verify_paths()
    for path in (paths.cafile, f"{paths.capath}/ca-certificates.crt" if paths.capath else None):
        if path and Path(path).is_file():
            return Path(path).read_bytes()
    loaded = ssl.create_default_context().get_ca_certs(binary_form=True)
    return "".join(map(ssl.DER_cert_to_PEM_cert, loaded)).encode() or None
