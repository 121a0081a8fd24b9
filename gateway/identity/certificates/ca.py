"""The fleet's certificate authority: a root, an intermediate that issues, and what they issue. No state, no files.

The root signs intermediates and nothing else, so its key may lie elsewhere. The intermediate issues certificates of
days to robots and of months to the gateway's own TLS servers. Robots know the root by its pin, not by a file.
"""

from __future__ import annotations

import ipaddress
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from gateway.identity.certificates.parsing import RobotKey, pin, robot_uri
from metaros.errors import ConfigError

__all__ = [
    "Authority",
    "ServerPair",
    "bridge",
    "issue_robot",
    "issue_server",
    "key_pem",
    "make_intermediate",
    "make_root",
    "pem",
    "supplied",
    "voucher",
]

PrivateKey = ec.EllipticCurvePrivateKey | ed25519.Ed25519PrivateKey | rsa.RSAPrivateKey
SKEW = timedelta(minutes=5)  # by how much a robot's clock may be behind ours
ROOT_DAYS, INTERMEDIATE_DAYS = 3652, 1095
SERVER_S = 90 * 86_400.0


@dataclass(frozen=True, slots=True)
class Authority:
    """An issuer with the root above it; `key` is None where it may only be recognised, not used."""

    root: x509.Certificate
    certificate: x509.Certificate
    key: PrivateKey | None = None

    @property
    def id(self) -> str:
        """The issuer's serial number, in hexadecimal."""
        return f"{self.certificate.serial_number:x}"

    @property
    def pin(self) -> str:
        """What enrolment tokens say of the root."""
        return pin(self.root)

    @property
    def chain_pem(self) -> str:
        """What goes with a leaf: the issuer, unless it is the root itself."""
        return "" if self.certificate == self.root else pem(self.certificate)

    @property
    def not_after_ns(self) -> int:
        """When it ends."""
        return round(self.certificate.not_valid_after_utc.timestamp()) * 1_000_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerPair:
    """What a TLS server needs: the chain (its own certificate first) and the key, in PEM, and when it ends."""

    chain_pem: bytes
    key_pem: bytes
    not_after_ns: int
    server_name: str = ""


def pem(*certificates: x509.Certificate) -> str:
    """Certificates as PEM text."""
    return "".join(certificate.public_bytes(Encoding.PEM).decode() for certificate in certificates)


def key_pem(key: PrivateKey) -> bytes:
    """A private key as PEM, not encrypted: the caller seals it, or keeps it 0600."""
    plain = serialization.NoEncryption()
    return key.private_bytes(Encoding.PEM, serialization.PrivateFormat.PKCS8, plain)


def make_root(fleet: str, *, now_ns: int) -> tuple[x509.Certificate, ec.EllipticCurvePrivateKey]:
    """A new root of a fleet, valid for ten years."""
    key, name = ec.generate_private_key(ec.SECP256R1()), _name(f"Meta-ROS {fleet} root")
    draft = _draft(name, name, key.public_key(), now_ns=now_ns, life=timedelta(days=ROOT_DAYS))
    return _authority(draft, key.public_key(), path_length=1).sign(key, hashes.SHA256()), key


def make_intermediate(
    fleet: str, root: x509.Certificate, root_key: ec.EllipticCurvePrivateKey, *, now_ns: int
) -> Authority:
    """A new issuer under the root, valid for three years or as long as the root."""
    key = ec.generate_private_key(ec.SECP256R1())
    life = min(timedelta(days=INTERMEDIATE_DAYS), root.not_valid_after_utc - _moment(now_ns))
    draft = _draft(_name(f"Meta-ROS {fleet} issuer"), root.subject, key.public_key(), now_ns=now_ns, life=life)
    draft = _authority(draft, key.public_key(), path_length=0)
    return Authority(root, _under(draft, root).sign(root_key, hashes.SHA256()), key)


def bridge(
    authority: Authority, root: x509.Certificate, root_key: ec.EllipticCurvePrivateKey, *, now_ns: int
) -> Authority:
    """The same issuer, with the same key, under the root before: who knows only that one believes it, too."""
    issuer = authority.certificate
    key = issuer.public_key()
    if not isinstance(key, ec.EllipticCurvePublicKey):
        raise ValueError("only an issuer of our own has a bridge")
    life = min(timedelta(days=INTERMEDIATE_DAYS), root.not_valid_after_utc - _moment(now_ns))
    draft = _authority(_draft(issuer.subject, root.subject, key, now_ns=now_ns, life=life), key, path_length=0)
    return Authority(root, _under(draft, root).sign(root_key, hashes.SHA256()), authority.key)


def voucher(
    root: x509.Certificate, before: x509.Certificate, before_key: ec.EllipticCurvePrivateKey, *, now_ns: int
) -> x509.Certificate:
    """What the root before says of its successor: this name has this key. It is no authority, and nothing is under it.

    A robot that reaches its gateway through somebody else's TLS takes the new root by this, and by nothing less.
    """
    key = root.public_key()
    if not isinstance(key, ec.EllipticCurvePublicKey):
        raise ValueError("only a root of our own is vouched for")
    life = min(timedelta(days=ROOT_DAYS), before.not_valid_after_utc - _moment(now_ns))
    draft = _draft(root.subject, before.subject, key, now_ns=now_ns, life=life)
    draft = draft.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
    return _under(draft, before).sign(before_key, hashes.SHA256())


def supplied(certificates_pem: bytes, private_pem: bytes, *, now_ns: int) -> Authority:
    """An issuer that somebody else made: its certificate first, its root last, and the issuer's key.

    Raises:
        ConfigError: it cannot issue; the message says why.
    """
    try:
        certificates = x509.load_pem_x509_certificates(certificates_pem)
        key = serialization.load_pem_private_key(private_pem, password=None)
    except (ValueError, TypeError) as error:
        raise ConfigError(f"--ca-cert and --ca-key: not PEM of certificates and a plain key: {error}") from error
    if not isinstance(key, PrivateKey):
        raise ConfigError("--ca-key: a key of P-256, P-384, Ed25519 or RSA is needed")
    issuer, root = certificates[0], certificates[-1]
    if _spki(issuer) != key.public_key().public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo):
        raise ConfigError("--ca-key: not the key of the first certificate in --ca-cert")
    for below, above in zip(certificates, [*certificates[1:], root], strict=True):
        _check_supplied(below, above, now_ns=now_ns)
    return Authority(root, issuer, key)


def issue_robot(
    authority: Authority, key: RobotKey, *, fleet: str, robot: str, now_ns: int, life_s: float
) -> x509.Certificate:
    """A robot's certificate: its one name, client authentication only, no authority over anything."""
    name = _name(robot)
    draft = _leaf(authority, name, key, now_ns=now_ns, life_s=life_s, usage=ExtendedKeyUsageOID.CLIENT_AUTH)
    names = x509.SubjectAlternativeName([x509.UniformResourceIdentifier(robot_uri(fleet, robot))])
    return _signed(authority, draft.add_extension(names, critical=False))


def issue_server(authority: Authority, names: Iterable[str], *, now_ns: int) -> ServerPair:
    """A certificate for the gateway's own servers under these host names and addresses, with a key of its own."""
    key, wanted = ec.generate_private_key(ec.SECP256R1()), list(dict.fromkeys(names))
    usage = ExtendedKeyUsageOID.SERVER_AUTH
    draft = _leaf(authority, _name("gateway"), key.public_key(), now_ns=now_ns, life_s=SERVER_S, usage=usage)
    alternatives = x509.SubjectAlternativeName([_alternative(name) for name in wanted])
    leaf = _signed(authority, draft.add_extension(alternatives, critical=False))
    return ServerPair(
        chain_pem=(pem(leaf) + authority.chain_pem).encode(),
        key_pem=key_pem(key),
        not_after_ns=round(leaf.not_valid_after_utc.timestamp()) * 1_000_000_000,
        server_name=wanted[0],
    )


def _leaf(
    authority: Authority,
    name: x509.Name,
    key: RobotKey,
    *,
    now_ns: int,
    life_s: float,
    usage: x509.ObjectIdentifier,
) -> x509.CertificateBuilder:
    """The draft of a certificate that is no authority; it never outlives its issuer."""
    life = min(timedelta(seconds=life_s), authority.certificate.not_valid_after_utc - _moment(now_ns))
    draft = _draft(name, authority.certificate.subject, key, now_ns=now_ns, life=life)
    draft = draft.add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
    draft = draft.add_extension(_key_usage(digital_signature=True), critical=True)
    return _under(draft.add_extension(x509.ExtendedKeyUsage([usage]), critical=False), authority.certificate)


def _draft(
    subject: x509.Name, issuer: x509.Name, key: RobotKey, *, now_ns: int, life: timedelta
) -> x509.CertificateBuilder:
    now = _moment(now_ns)
    return (
        x509.CertificateBuilder()
        .subject_name(subject)
        .issuer_name(issuer)
        .public_key(key)
        .serial_number(x509.random_serial_number())
        .not_valid_before(now - SKEW)
        .not_valid_after(now + life)
        .add_extension(x509.SubjectKeyIdentifier.from_public_key(key), critical=False)
    )


def _authority(draft: x509.CertificateBuilder, key: RobotKey, *, path_length: int) -> x509.CertificateBuilder:
    constraints = x509.BasicConstraints(ca=True, path_length=path_length)
    return draft.add_extension(constraints, critical=True).add_extension(_key_usage(key_cert_sign=True), critical=True)


def _under(draft: x509.CertificateBuilder, issuer: x509.Certificate) -> x509.CertificateBuilder:
    try:
        known = issuer.extensions.get_extension_for_class(x509.SubjectKeyIdentifier).value
    except x509.ExtensionNotFound:
        above = x509.SubjectKeyIdentifier.from_public_key(issuer.public_key())
    else:
        above = known
    identifier = x509.AuthorityKeyIdentifier.from_issuer_subject_key_identifier(above)
    return draft.add_extension(identifier, critical=False)


def _signed(authority: Authority, draft: x509.CertificateBuilder) -> x509.Certificate:
    key = authority.key
    if key is None:
        raise ValueError("an authority without its key issues nothing")
    return draft.sign(key, None if isinstance(key, ed25519.Ed25519PrivateKey) else hashes.SHA256())


def _key_usage(*, digital_signature: bool = False, key_cert_sign: bool = False) -> x509.KeyUsage:
    return x509.KeyUsage(
        digital_signature=digital_signature,
        content_commitment=False,
        key_encipherment=False,
        data_encipherment=False,
        key_agreement=False,
        key_cert_sign=key_cert_sign,
        crl_sign=key_cert_sign,
        encipher_only=False,
        decipher_only=False,
    )


def _check_supplied(certificate: x509.Certificate, above: x509.Certificate, *, now_ns: int) -> None:
    name, now = certificate.subject.rfc4514_string(), _moment(now_ns)
    try:
        constraints = certificate.extensions.get_extension_for_class(x509.BasicConstraints).value
    except x509.ExtensionNotFound:
        raise ConfigError(f"--ca-cert: {name} is no certificate authority") from None
    if not constraints.ca:
        raise ConfigError(f"--ca-cert: {name} is no certificate authority")
    if not certificate.not_valid_before_utc <= now < certificate.not_valid_after_utc:
        raise ConfigError(f"--ca-cert: {name} is valid until {certificate.not_valid_after_utc.isoformat()} only")
    try:
        certificate.verify_directly_issued_by(above)
    except Exception as error:  # a mismatch, a bad signature, or a kind of signature that is not known
        raise ConfigError(
            f"--ca-cert: {name} is not issued by the next certificate: the issuer comes first, its root last"
        ) from error


def _alternative(name: str) -> x509.GeneralName:
    try:
        return x509.IPAddress(ipaddress.ip_address(name.strip("[]")))
    except ValueError:
        return x509.DNSName(name)


def _name(text: str) -> x509.Name:
    return x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, text[:64])])


def _moment(now_ns: int) -> datetime:
    return datetime.fromtimestamp(now_ns // 1_000_000_000, UTC)


def _spki(certificate: x509.Certificate) -> bytes:
    return certificate.public_key().public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)
