"""The fake gateway with mutual TLS: a fleet's own authority, client certificates, and the signed challenge."""

from __future__ import annotations

import os
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, TypeVar

import grpc
import grpc.aio
from cryptography import x509

from metaros._proto import link_pb2, link_pb2_grpc
from metaros.link.proof import link_statement, verify
from tests.support.gateways.fake_gateway import OPTIONS, FakeGateway
from tests.support.gateways.fake_gateway_ws import WebSocketGateway
from tests.support.servers.fleet_ca import FleetCa

__all__ = ["GuardedGrpc", "GuardedSocket", "guarded", "server_context"]


def server_context(ca: FleetCa, folder: Path) -> ssl.SSLContext:
    """TLS of a server of that fleet."""
    key, chain = ca.server()
    (folder / "server.pem").write_text(key + chain)
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(folder / "server.pem")
    return context


class Guard(FakeGateway):
    """Lets a lane in by its client certificate, else by a proof. `shown`: who came in; `proofs`: how many proved it."""

    ca: FleetCa
    audience = ""
    challenges = 0
    proofs = 0
    shown: tuple[str, ...] = ()

    async def Connect(self, request: AsyncIterator[link_pb2.AgentFrame], context: Any) -> None:
        """One lane; nothing of it reaches the gateway before its robot is known."""
        frames = aiter(request)
        first = await anext(frames)
        names = self._names_in_tls(context) or await self._challenged(first.hello, frames, context)
        self.shown = (*self.shown, *names)

        async def all_frames() -> AsyncIterator[link_pb2.AgentFrame]:
            yield first
            async for frame in frames:
                yield frame

        await super().Connect(all_frames(), context)

    def _names_in_tls(self, context: Any) -> list[str]:
        if not hasattr(context, "auth_context"):  # a WebSocket
            return []
        return [name.decode() for name in context.auth_context().get("x509_subject_alternative_name", [])]

    async def _challenged(self, hello: link_pb2.Hello, frames: Any, context: Any) -> list[str]:
        nonce, audience = os.urandom(32), self.audience or self.ca.fleet
        self.challenges += 1
        await context.write(link_pb2.GatewayFrame(challenge=link_pb2.Challenge(nonce=nonce, audience=audience)))
        proof = await anext(frames)
        leaf = x509.load_der_x509_certificate(hello.certificates[0])
        leaf.verify_directly_issued_by(self.ca.intermediate)
        statement = link_statement(
            nonce,
            audience=audience,
            robot_id=hello.robot_id,
            session_id=hello.session_id,
            session_number=hello.session_number,
            lane=hello.lane,
        )
        assert verify(leaf.public_key(), statement, proof.proof.signature)
        self.proofs += 1
        names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        return [str(name.value) for name in names]


G = TypeVar("G", bound=Guard)


class GuardedGrpc(Guard):
    """Over gRPC: plain, with TLS, or with TLS that requires the robot's certificate."""

    def __init__(self, ca: FleetCa, *, tls: bool = True, mutual: bool = True, served_by: FleetCa | None = None) -> None:
        super().__init__()
        self.ca, self._tls, self._mutual, self._served_by = ca, tls, mutual, served_by or ca

    async def start(self) -> None:
        """Listen."""
        self._server = grpc.aio.server(options=OPTIONS)
        link_pb2_grpc.add_LinkServicer_to_server(self, self._server)
        if self._tls:
            key, chain = self._served_by.server()
            roots = self.ca.roots.encode() if self._mutual else None
            pair = [(key.encode(), chain.encode())]
            credentials = grpc.ssl_server_credentials(pair, roots, require_client_auth=self._mutual)
            assert self._server.add_secure_port(self.target, credentials) == self.port
        else:
            assert self._server.add_insecure_port(self.target) == self.port
        await self._server.start()


class GuardedSocket(Guard, WebSocketGateway):
    """Over WebSockets, with TLS where a context is given."""

    def __init__(self, ca: FleetCa, context: ssl.SSLContext | None = None) -> None:
        super().__init__(ssl=context)
        self.ca = ca


@asynccontextmanager
async def guarded(gateway: G) -> AsyncIterator[G]:
    """That gateway, listening."""
    await gateway.start()
    try:
        yield gateway
    finally:
        await gateway.stop()
