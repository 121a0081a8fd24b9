"""The credentials of an enrolled robot on its link: certificates, proofs, and trusted roots.

One object lives as long as the agent; a renewal puts another identity in, which the next connection uses.
"""

from __future__ import annotations

import ssl
from collections.abc import Sequence
from urllib.parse import urlsplit

from edge_agent.config.gateway_address import GatewayAddress, TransportSetting, parse_address
from edge_agent.errors import InsecureGatewayError, UnprovenError
from edge_agent.identity.files import RobotIdentity
from edge_agent.identity.gateway_http import is_loopback, verified
from metaros._proto import link_pb2
from metaros.link.proof import NONCE_BYTES, link_statement, sign

__all__ = ["Credentials", "check_addresses", "enrolled_addresses"]


class Credentials:
    """The identity that holds now."""

    def __init__(self, identity: RobotIdentity) -> None:
        self.identity = identity

    def certificates(self) -> list[bytes]:
        """For a Hello: its own certificate first, then what leads to the root; DER."""
        return self.identity.certificates()

    def prove(self, hello: link_pb2.Hello, challenge: link_pb2.Challenge) -> link_pb2.Proof:
        """The answer to a challenge on that Hello's lane. Raises UnprovenError: the challenge is not for us."""
        if challenge.audience != self.identity.fleet or len(challenge.nonce) != NONCE_BYTES:
            raise UnprovenError(
                f"the gateway asks as fleet {challenge.audience[:80]!r}, this robot belongs to {self.identity.fleet!r}"
            )
        statement = link_statement(
            challenge.nonce,
            audience=challenge.audience,
            robot_id=hello.robot_id,
            session_id=hello.session_id,
            session_number=hello.session_number,
            lane=hello.lane,
        )
        return link_pb2.Proof(signature=sign(self.identity.private_key(), statement))

    def key_and_chain(self) -> tuple[bytes, bytes]:
        """Private key and certificate chain as PEM, for a client certificate."""
        return self.identity.key.encode(), (self.identity.certificate + self.identity.chain).encode()

    def roots(self, system: bytes | None) -> bytes:
        """Who may vouch for a gateway, as PEM: the fleet's root, and what the enrolment found to be needed."""
        own = self.identity.roots.encode()
        return own + b"\n" + system if self.identity.system_trust and system else own

    def context(self) -> ssl.SSLContext:
        """The same for a WebSocket."""
        return verified(self.identity.roots, system=self.identity.system_trust)


def enrolled_addresses(identity: RobotIdentity, setting: TransportSetting) -> list[GatewayAddress]:
    """Where the gateway of the enrolment is: its gRPC port, then what its URL serves. Raises ConfigError."""
    host = urlsplit(identity.url).hostname or ""
    place = f"[{host}]" if ":" in host else host
    texts = [identity.url]
    if identity.grpc_port and (identity.grpc_tls or is_loopback(host)):
        texts.insert(0, f"{'grpcs' if identity.grpc_tls else 'grpc'}://{place}:{identity.grpc_port}")
    found = [parse_address(text) for text in texts]
    return [item.only(setting) for item in found if setting in ("auto", *item.transports)]


def check_addresses(addresses: Sequence[GatewayAddress]) -> None:
    """That nobody on the way can be taken for the gateway. Raises InsecureGatewayError."""
    for address in addresses:
        if not address.tls and not is_loopback(address.host):
            raise InsecureGatewayError(
                f"gateway {address.text!r} has no TLS: beyond this machine an enrolled robot speaks https:// or grpcs://"
            )
