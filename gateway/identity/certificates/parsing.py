"""Parses what robots send: certificate requests and certificates; nothing in them is trusted unchecked.

A robot's name is `spiffe://FLEET/robot/ID`, the one subject alternative name of its certificate. Whatever else a
request asks for is refused, never quietly left out: whoever asks for CA:TRUE should hear that it was noticed.
"""

from __future__ import annotations

import base64
import hashlib
from collections.abc import Sequence
from dataclasses import dataclass

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives.asymmetric import ec, ed25519
from cryptography.hazmat.primitives.serialization import Encoding, PublicFormat
from cryptography.x509.oid import ExtendedKeyUsageOID, ExtensionOID

from gateway.errors import IdentityError
from metaros.link.proof import CURVES

__all__ = [
    "RobotCertificate",
    "RobotKey",
    "check_csr",
    "issued_by",
    "issuer_key",
    "key_id",
    "load_certificate",
    "pin",
    "read_robot",
    "robot_uri",
    "subject_key",
]

RobotKey = ec.EllipticCurvePublicKey | ed25519.Ed25519PublicKey
MAX_PEM_BYTES = 16 * 1024
_UNREADABLE = (
    ValueError,
    UnsupportedAlgorithm,
    x509.InvalidVersion,
    x509.DuplicateExtension,
    x509.UnsupportedGeneralNameType,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotCertificate:
    """A certificate that one of our authorities issued to a robot; times in nanoseconds since the epoch."""

    robot: str
    serial: str  # hexadecimal
    key: RobotKey
    not_before_ns: int
    not_after_ns: int
    issuer: str = ""  # the issuer's key, as `subject_key` says it


def subject_key(issuer: x509.Certificate) -> str:
    """By what the certificates of an issuer name its key, in hexadecimal."""
    try:
        return issuer.extensions.get_extension_for_class(x509.SubjectKeyIdentifier).value.digest.hex()
    except x509.ExtensionNotFound:
        return x509.SubjectKeyIdentifier.from_public_key(issuer.public_key()).digest.hex()


def issuer_key(certificate: x509.Certificate) -> str:
    """The key that a certificate says has signed it, as `subject_key` says it; "" where it says nothing."""
    try:
        known = certificate.extensions.get_extension_for_class(x509.AuthorityKeyIdentifier).value.key_identifier
    except x509.ExtensionNotFound:
        return ""
    return known.hex() if known is not None else ""


def robot_uri(fleet: str, robot: str) -> str:
    """The name that a robot's certificate bears."""
    return f"spiffe://{fleet}/robot/{robot}"


def key_id(key: RobotKey) -> str:
    """A public key's fingerprint: the SHA-256 of its SubjectPublicKeyInfo, in hexadecimal."""
    return hashlib.sha256(key.public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)).hexdigest()


def pin(certificate: x509.Certificate) -> str:
    """By what an enrolment token knows a root: the SHA-256 of its SubjectPublicKeyInfo, base64url without padding."""
    spki = certificate.public_key().public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo)
    return base64.urlsafe_b64encode(hashlib.sha256(spki).digest()).decode().rstrip("=")


def check_csr(pem: str, *, fleet: str, robot: str) -> tuple[RobotKey, bytes]:
    """The public key that a request wants certified for this robot, and the request in DER.

    Raises:
        IdentityError: csr_refused; the message names what is wrong or what it asks for beyond the robot's own name.
    """
    if pem.count("-----BEGIN ") != 1:
        raise IdentityError("csr_refused", "a certificate request is sent alone: nothing beside it, and no private key")
    try:
        csr = x509.load_pem_x509_csr(_bounded(pem))
        # The kind of key first: to look at the signature of an RSA key of 16,384 bits is work for the one who has to.
        checked = _robot_key(csr.public_key())
        if checked is None:
            raise IdentityError("csr_refused", "the certificate request's key is not P-256, P-384 or Ed25519")
        valid, extensions = csr.is_signature_valid, csr.extensions
    except _UNREADABLE as error:
        raise IdentityError("csr_refused", f"the certificate request cannot be read: {error}"[:300]) from error
    if not valid:
        raise IdentityError("csr_refused", "the certificate request is not signed by the key in it")
    for extension in extensions:
        _check_asked(extension, robot_uri(fleet, robot))
    return checked, csr.public_bytes(Encoding.DER)


def load_certificate(data: bytes | str) -> x509.Certificate:
    """A certificate from PEM text or DER bytes; IdentityError when it is none."""
    try:
        if isinstance(data, str) or data.startswith(b"-----"):
            return x509.load_pem_x509_certificate(_bounded(data))
        return x509.load_der_x509_certificate(_bounded(data))
    except _UNREADABLE as error:
        raise IdentityError("certificate_foreign", f"the certificate cannot be read: {error}"[:300]) from error


def read_robot(
    certificate: x509.Certificate,
    issuers: Sequence[x509.Certificate],
    *,
    fleet: str,
    now_ns: int,
    grace_s: float = 0.0,
) -> RobotCertificate:
    """Whose certificate it is. It has to be issued by one of `issuers` itself; `grace_s` forgives a late end.

    Raises:
        IdentityError: certificate_foreign or certificate_expired.
    """
    issuer = next((one for one in issuers if issued_by(certificate, one)), None)
    if issuer is None:
        raise IdentityError("certificate_foreign", "the certificate was not issued by this fleet's authority")
    robot, key = _named_robot(certificate, fleet), _robot_key(certificate.public_key())
    if robot is None or key is None:
        raise IdentityError("certificate_foreign", f"the certificate is not that of a robot of fleet {fleet}")
    not_before_ns = round(certificate.not_valid_before_utc.timestamp()) * 1_000_000_000
    not_after_ns = round(certificate.not_valid_after_utc.timestamp()) * 1_000_000_000
    if now_ns < not_before_ns:
        raise IdentityError("certificate_expired", f"the certificate of {robot} is not valid yet: is a clock wrong?")
    if now_ns >= not_after_ns + round(grace_s * 1e9):
        ended = certificate.not_valid_after_utc.isoformat()
        raise IdentityError("certificate_expired", f"the certificate of {robot} ended at {ended}")
    return RobotCertificate(
        robot=robot,
        serial=f"{certificate.serial_number:x}",
        key=key,
        not_before_ns=not_before_ns,
        not_after_ns=not_after_ns,
        issuer=subject_key(issuer),
    )


def _bounded(data: bytes | str) -> bytes:
    raw = data.encode() if isinstance(data, str) else data
    if len(raw) > MAX_PEM_BYTES:
        raise ValueError(f"it is over {MAX_PEM_BYTES} bytes")
    return raw


def _robot_key(key: object) -> RobotKey | None:
    if isinstance(key, ed25519.Ed25519PublicKey):
        return key
    if isinstance(key, ec.EllipticCurvePublicKey) and key.curve.name in CURVES:
        return key
    return None


def _check_asked(extension: x509.Extension[x509.ExtensionType], uri: str) -> None:
    value = extension.value
    if isinstance(value, x509.BasicConstraints):
        asked = "CA:TRUE" if value.ca else "CA:FALSE"
        raise IdentityError("csr_refused", f"the certificate request asks for {asked}: leave basicConstraints out")
    if not isinstance(value, x509.SubjectAlternativeName):
        name = extension.oid._name if extension.oid._name != "Unknown OID" else extension.oid.dotted_string
        raise IdentityError("csr_refused", f"the certificate request asks for the extension {name}")
    names = list(value)
    if len(names) != 1 or not isinstance(names[0], x509.UniformResourceIdentifier) or names[0].value != uri:
        asked = ", ".join(str(name.value) for name in names)[:200]
        raise IdentityError("csr_refused", f"the certificate request asks for the name {asked!r}; only {uri} is given")


def issued_by(certificate: x509.Certificate, issuer: x509.Certificate) -> bool:
    """Whether that very issuer has signed it."""
    try:
        certificate.verify_directly_issued_by(issuer)
    except (ValueError, TypeError, InvalidSignature, UnsupportedAlgorithm):
        return False
    return True


def _named_robot(certificate: x509.Certificate, fleet: str) -> str | None:
    """The id in the one name; None for a server's certificate, an authority's, or one of another fleet."""
    try:
        extensions = certificate.extensions
        usage = extensions.get_extension_for_oid(ExtensionOID.EXTENDED_KEY_USAGE).value
        constraints = extensions.get_extension_for_class(x509.BasicConstraints).value
        names = list(extensions.get_extension_for_class(x509.SubjectAlternativeName).value)
    except (x509.ExtensionNotFound, *_UNREADABLE):
        return None
    if not isinstance(usage, x509.ExtendedKeyUsage) or list(usage) != [ExtendedKeyUsageOID.CLIENT_AUTH]:
        return None
    start = robot_uri(fleet, "")
    if constraints.ca or len(names) != 1 or not isinstance(names[0], x509.UniformResourceIdentifier):
        return None
    return names[0].value.removeprefix(start) if names[0].value.startswith(start) else None
