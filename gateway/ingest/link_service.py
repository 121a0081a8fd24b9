"""The gRPC shell of the link: one bidirectional stream is one lane."""

from __future__ import annotations

import ipaddress
import logging
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from typing import Any
from urllib.parse import unquote

import grpc
from google.protobuf.message import DecodeError

from gateway.domain.identity import Peer
from gateway.domain.networks import is_loopback_address, read_address
from gateway.ingest.lane_shell import LaneGoneError, serve_lane
from gateway.ingest.links import Links
from metaros._proto import link_pb2, link_pb2_grpc
from metaros.errors import ConfigError
from metaros.limits import LIMITS, Limits

__all__ = [
    "LinkService",
    "ServerTls",
    "address_of_peer",
    "forwarded",
    "is_local_peer",
    "make_server",
    "tls_credentials",
]

log = logging.getLogger(__name__)

FORWARDED = frozenset({"forwarded", "x-forwarded-for", "x-real-ip"})
STREAMS = 128  # of one connection; an agent has a connection for each of its three lanes
CONNECTIONS = 32_768
IDLE_MS = 60_000  # a connection without a lane is closed after so long
Context = grpc.aio.ServicerContext[link_pb2.AgentFrame, link_pb2.GatewayFrame]


class LinkService(link_pb2_grpc.LinkServicer):
    """Carries frames between gRPC and `Links`."""

    def __init__(self, links: Links) -> None:
        self._links = links

    async def Connect(self, request_iterator: AsyncIterator[link_pb2.AgentFrame], context: Context) -> None:
        """One lane from Hello to the end of its connection."""
        frames: AsyncIterator[link_pb2.AgentFrame] | None = None

        async def read() -> link_pb2.AgentFrame | None:
            nonlocal frames  # begun by the first read: of a lane that is refused at once nothing is read
            frames = frames or aiter(request_iterator)
            try:
                return await anext(frames, None)
            except DecodeError:  # gRPC would log each with its traceback: anybody could fill the log
                log.debug("what came on a lane is no AgentFrame")
                return None

        async def write(frame: link_pb2.GatewayFrame) -> None:
            try:
                await context.write(frame)
            except (grpc.aio.InternalError, grpc.aio.UsageError) as error:
                # The robot's process or its network went: gRPC fails the write under way, and refuses later ones.
                raise LaneGoneError(f"gRPC did not take a frame: {error}") from error

        name, local = context.peer(), is_local_peer(context.peer()) and not forwarded(context)
        peer = Peer(_certificate(context), local, address_of_peer(name))
        await serve_lane(self._links, read, write, peer=peer)


@dataclass(frozen=True, slots=True)
class ServerTls:
    """What the server shows (chain and key in PEM), and the roots under which robots' certificates have to be."""

    chain_pem: bytes
    key_pem: bytes
    roots_pem: bytes


def tls_credentials(current: Callable[[], ServerTls]) -> grpc.ServerCredentials:
    """Credentials that ask every client for a certificate; `current` is asked at each handshake, on gRPC's threads."""
    first = current()
    told = [first]

    def changed() -> Any:  # None: as before
        now = current()
        if now == told[0]:
            return None
        told[0] = now
        return _configuration(now)

    return grpc.dynamic_ssl_server_credentials(_configuration(first), changed, require_client_authentication=True)


def make_server(
    links: Links,
    *,
    host: str,
    port: int,
    credentials: grpc.ServerCredentials | None = None,
    beside: Callable[[grpc.aio.Server], None] = lambda server: None,
    limits: Limits = LIMITS,
) -> tuple[grpc.aio.Server, int]:
    """A gRPC server bound to a port (0: any) that no other process shares; ConfigError when it is taken.

    `beside` adds the services that are not robots'. With `credentials` it speaks TLS, and who a robot is says its
    certificate.
    """
    server = grpc.aio.server(
        options=[
            ("grpc.so_reuseport", 0),
            ("grpc.max_receive_message_length", limits.frame_bytes),
            ("grpc.max_send_message_length", limits.frame_bytes),
            ("grpc.keepalive_time_ms", 10_000),
            ("grpc.keepalive_timeout_ms", 5_000),
            # Agents ping every heartbeat: that must never look like a flood, whatever the jitter.
            ("grpc.http2.min_ping_interval_without_data_ms", 1_000),
            ("grpc.http2.max_ping_strikes", 32),
            ("grpc.max_concurrent_streams", STREAMS),
            ("grpc.max_metadata_size", limits.head_bytes),
            ("grpc.server_handshake_timeout_ms", round(limits.head_s * 1000)),
            ("grpc.max_connection_idle_ms", IDLE_MS),
            ("grpc.max_allowed_incoming_connections", CONNECTIONS),
        ]
    )
    link_pb2_grpc.add_LinkServicer_to_server(LinkService(links), server)
    beside(server)
    try:
        address = f"[{host}]:{port}" if ":" in host else f"{host}:{port}"
        if credentials is None:
            bound = server.add_insecure_port(address)
        else:
            bound = server.add_secure_port(address, credentials)
    except RuntimeError as error:
        raise ConfigError(f"port {port} for robots cannot be opened: {error}") from error
    return server, bound


def _configuration(tls: ServerTls) -> grpc.ServerCertificateConfiguration:
    return grpc.ssl_server_certificate_configuration([(tls.key_pem, tls.chain_pem)], root_certificates=tls.roots_pem)


def _certificate(context: Context) -> bytes | None:
    """The client's certificate as TLS verified it; None without TLS. Metadata says nothing about who somebody is."""
    return next(iter(context.auth_context().get("x509_pem_cert", ())), None)


def forwarded(context: grpc.aio.ServicerContext[Any, Any]) -> bool:
    """Whether a proxy says that somebody else sent this: then the address of its connection says nothing."""
    return any(key in FORWARDED for key, _ in context.invocation_metadata() or ())


def is_local_peer(peer: str) -> bool:
    """Whether gRPC's name of a peer, such as ipv4:127.0.0.1:5000 or ipv6:%5B::1%5D:5000, is on this machine."""
    kind, _, address = peer.partition(":")
    if kind == "unix":
        return True
    return is_loopback_address(_host(address))


def address_of_peer(peer: str) -> str:
    """Whom an address counts for; an IPv6 host by its /64 network."""
    found = read_address(_host(peer.partition(":")[2]))
    if found is None:
        return ""
    return str(found) if found.version == 4 else str(ipaddress.ip_network((found, 64), strict=False))


def _host(address: str) -> str:
    return unquote(address).rpartition(":")[0].strip("[]")
