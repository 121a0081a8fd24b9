"""What the gateway's two gRPC ports have in common: how they are opened, their TLS, and what they bear.

Robots' port asks every client for a certificate, so people's programs, which have keys, need one of their own.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import grpc

from metaros.errors import ConfigError
from metaros.limits import LIMITS, Limits

__all__ = ["ServerTls", "make_server"]

STREAMS = 128  # of one connection; an agent has a connection for each of its three lanes
ANY_PORT_TRIES = 5  # gRPC looks for a free port of all addresses before it binds it: it may be another's by then
IDLE_MS = 60_000  # a connection without a call is closed after so long


@dataclass(frozen=True, slots=True)
class ServerTls:
    """What a port shows: chain and key in PEM of each certificate; the first that holds the caller's name, else the
    very first.

    With `clients` every client shows a certificate too, under these roots.
    """

    pairs: tuple[tuple[bytes, bytes], ...]
    clients: bytes | None = None


def _credentials(current: Callable[[], ServerTls]) -> grpc.ServerCredentials:
    """For one attempt to open a port, after which gRPC takes them no more.

    `current` is asked at each handshake, on gRPC's threads; whether clients are asked is settled by the first.
    """
    first = current()
    last = [first]

    def changed() -> Any:  # None: as before
        now = current()
        if now == last[0]:
            return None
        last[0] = now
        return _configuration(now)

    asks = first.clients is not None
    return grpc.dynamic_ssl_server_credentials(_configuration(first), changed, require_client_authentication=asks)


def make_server(
    add: Callable[[grpc.aio.Server], None],
    *,
    host: str,
    port: int,
    connections: int,
    tls: Callable[[], ServerTls] | None = None,
    limits: Limits = LIMITS,
) -> tuple[grpc.aio.Server, int]:
    """A server bound to a port (0: any) that no other process shares; ConfigError when it is taken.

    `add` gives it its services, `tls` what it shows now, if it has TLS. What nobody reads waits at its client: a call
    that is refused by its metadata costs no more than HTTP/2's first window, however long its message is.
    """
    server = grpc.aio.server(
        options=[
            ("grpc.so_reuseport", 0),
            ("grpc.max_receive_message_length", limits.frame_bytes),
            ("grpc.max_send_message_length", limits.sample_bytes + limits.frame_bytes),
            ("grpc.keepalive_time_ms", 10_000),
            ("grpc.keepalive_timeout_ms", 5_000),
            # Agents ping every heartbeat: that must never look like a flood, whatever the jitter.
            ("grpc.http2.min_ping_interval_without_data_ms", 1_000),
            ("grpc.http2.max_ping_strikes", 32),
            ("grpc.max_concurrent_streams", STREAMS),
            ("grpc.max_metadata_size", limits.head_bytes),
            ("grpc.server_handshake_timeout_ms", round(limits.head_s * 1000)),
            ("grpc.max_connection_idle_ms", IDLE_MS),
            ("grpc.max_allowed_incoming_connections", connections),
        ]
    )
    add(server)
    return server, _bound(server, f"[{host}]:{port}" if ":" in host else f"{host}:{port}", port, tls)


def _bound(server: grpc.aio.Server, address: str, port: int, tls: Callable[[], ServerTls] | None) -> int:
    """The port that it is bound to; any port (0) is looked for again where it was taken meanwhile."""
    tries = ANY_PORT_TRIES if port == 0 else 1
    while True:
        tries -= 1
        try:
            if tls is None:
                return int(server.add_insecure_port(address))
            return int(server.add_secure_port(address, _credentials(tls)))
        except RuntimeError as error:
            if not tries:
                raise ConfigError(f"port {port} cannot be opened: {error}") from error


def _configuration(tls: ServerTls) -> grpc.ServerCertificateConfiguration:
    pairs = [(key, chain) for chain, key in tls.pairs]
    return grpc.ssl_server_certificate_configuration(pairs, root_certificates=tls.clients)
