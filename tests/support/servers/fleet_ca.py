"""A small fleet authority for the agent's tests: a root, an intermediate, and certificates of any length."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import NameOID

from edge_agent.identity.enrolment_token import spki_pin
from edge_agent.identity.key import key_to_pem, new_key

__all__ = ["FleetCa", "pem"]

DAY = timedelta(days=1)


def pem(certificate: x509.Certificate) -> str:
    """As text."""
    return certificate.public_bytes(serialization.Encoding.PEM).decode()


def _named(name: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, name)])


class FleetCa:
    """Signs what it is asked to; checks nothing."""

    def __init__(self, fleet: str = "testfleet") -> None:
        self.fleet = fleet
        self._root_key, self._key = new_key(), new_key()
        self.root = self._certify(_named("root"), self._root_key.public_key(), None, ca=True)
        self.intermediate = self._certify(_named("intermediate"), self._key.public_key(), self.root, ca=True)

    @property
    def roots(self) -> str:
        """The root as PEM."""
        return pem(self.root)

    @property
    def chain(self) -> str:
        """The intermediate as PEM."""
        return pem(self.intermediate)

    @property
    def pin(self) -> str:
        """The root's."""
        return spki_pin(self.root)

    def token(self, token_id: str = "t1", secret: str = "0" * 32) -> str:
        """A token of this fleet."""
        return f"mr1.{token_id}.{secret}.{self.pin}"

    def robot(self, public_key: Any, robot_id: str, *, begin: timedelta = -DAY, life: timedelta = 2 * DAY) -> str:
        """A robot's certificate that began `begin` from now."""
        uri = x509.UniformResourceIdentifier(f"spiffe://{self.fleet}/robot/{robot_id}")
        return pem(self._certify(_named(robot_id), public_key, self.intermediate, [uri], begin=begin, life=life))

    def server(self) -> tuple[str, str]:
        """Key and chain of a server on this machine, as PEM."""
        key = new_key()
        names = [x509.DNSName("localhost"), x509.IPAddress(ip_address("127.0.0.1"))]
        leaf = self._certify(_named("gateway"), key.public_key(), self.intermediate, names)
        return key_to_pem(key), pem(leaf) + self.chain

    def _certify(
        self,
        subject: x509.Name,
        public_key: ec.EllipticCurvePublicKey,
        issuer: x509.Certificate | None,
        names: list[Any] | None = None,
        *,
        ca: bool = False,
        begin: timedelta = -DAY,
        life: timedelta = 2 * DAY,
    ) -> x509.Certificate:
        start = datetime.now(UTC).replace(microsecond=0) + begin
        signer = self._key if issuer is not None and not ca else self._root_key
        builder = (
            x509.CertificateBuilder()
            .subject_name(subject)
            .issuer_name(subject if issuer is None else issuer.subject)
            .public_key(public_key)
            .serial_number(x509.random_serial_number())
            .not_valid_before(start)
            .not_valid_after(start + life)
            .add_extension(x509.BasicConstraints(ca=ca, path_length=None), critical=True)
            .add_extension(x509.SubjectKeyIdentifier.from_public_key(public_key), critical=False)
            .add_extension(x509.AuthorityKeyIdentifier.from_issuer_public_key(signer.public_key()), critical=False)
        )
        if names:
            builder = builder.add_extension(x509.SubjectAlternativeName(names), critical=False)
        return builder.sign(signer, hashes.SHA256())
