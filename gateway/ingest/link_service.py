"""The gRPC shell of the link: one bidirectional stream is one lane."""

from __future__ import annotations

import ipaddress
import logging
from collections.abc import AsyncIterator
from typing import Any
from urllib.parse import unquote

import grpc
from google.protobuf.message import DecodeError

from gateway.domain.identity import Peer
from gateway.domain.networks import is_loopback_address, read_address
from gateway.ingest.lane_server import LaneGoneError, serve_lane
from gateway.ingest.links import Links
from metaros._proto import link_pb2, link_pb2_grpc

__all__ = ["LinkService", "add_links", "address_of_peer", "forwarded", "is_local_peer"]

log = logging.getLogger(__name__)

FORWARDED = frozenset({"forwarded", "x-forwarded-for", "x-real-ip"})
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


def add_links(server: grpc.aio.Server, links: Links) -> None:
    """Serve robots' links."""
    link_pb2_grpc.add_LinkServicer_to_server(LinkService(links), server)


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
