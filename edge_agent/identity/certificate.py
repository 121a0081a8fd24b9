"""The robot's certificate, as far as the agent looks at it: whose key, which name, when, and signed by whom."""

from __future__ import annotations

from dataclasses import dataclass

from cryptography import x509
from cryptography.exceptions import InvalidSignature, UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization

from edge_agent.errors import EnrolAnswerError
from edge_agent.identity.csr import robot_uri
from edge_agent.identity.key import PrivateKey, public_der

__all__ = ["Validity", "certificates_der", "check_issued", "validity_of", "vouched_roots"]

MOST_IN_A_CHAIN = 8
UNREADABLE = (x509.ExtensionNotFound, x509.DuplicateExtension, x509.InvalidVersion, x509.UnsupportedGeneralNameType)
NS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Validity:
    """When a certificate holds, as wall time in ns since the epoch."""

    not_before_ns: int
    not_after_ns: int


def validity_of(certificate_pem: str) -> Validity:
    """When a certificate holds. Raises ValueError for what is none."""
    leaf = x509.load_pem_x509_certificate(certificate_pem.encode())
    begin, end = leaf.not_valid_before_utc, leaf.not_valid_after_utc
    return Validity(round(begin.timestamp()) * NS, round(end.timestamp()) * NS)


def certificates_der(*pems: str) -> list[bytes]:
    """All certificates of some PEM texts, in order, as DER. Raises ValueError."""
    text = "".join(pems).encode()
    return [item.public_bytes(serialization.Encoding.DER) for item in x509.load_pem_x509_certificates(text)]


def check_issued(certificate: str, chain: str, roots: str, *, key: PrivateKey, fleet: str, robot_id: str) -> None:
    """That it is this robot's, for this key, and signed up to one of the roots.

    Raises EnrolAnswerError. The times are not looked at: the robot's clock may be wrong, and the gateway's decides.
    """
    try:
        leaf, *rest = x509.load_pem_x509_certificates((certificate + chain).encode())
        trusted = x509.load_pem_x509_certificates(roots.encode())
        names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        uris = names.get_values_for_type(x509.UniformResourceIdentifier)
        spki = leaf.public_key().public_bytes(
            serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo
        )
    except (ValueError, UnsupportedAlgorithm, *UNREADABLE) as error:
        raise EnrolAnswerError(f"the gateway's answer holds no proper certificate: {error}") from error
    if spki != public_der(key):
        raise EnrolAnswerError("the gateway's certificate is for another key than this robot's")
    if uris != [robot_uri(fleet, robot_id)]:
        raise EnrolAnswerError(f"the gateway's certificate is for {', '.join(uris) or 'nobody'}, not for {robot_id}")
    _check_chain(leaf, rest[:MOST_IN_A_CHAIN], trusted[:MOST_IN_A_CHAIN])


def vouched_roots(trusted: str, named: str, vouchers: str) -> str:
    """Those of the named roots that are trusted already, or that a trusted root confirms in a voucher; PEM.

    A voucher is a certificate of the new root's name and key, signed by the old root, and no authority itself: an
    issuer's certificate, whose key lies at the gateway, vouches for nobody. Raises EnrolAnswerError.
    """
    try:
        known = x509.load_pem_x509_certificates(trusted.encode())[:MOST_IN_A_CHAIN]
        roots = x509.load_pem_x509_certificates(named.encode())[:MOST_IN_A_CHAIN]
        said = x509.load_pem_x509_certificates(vouchers.encode())[:MOST_IN_A_CHAIN] if vouchers else []
    except ValueError as error:
        raise EnrolAnswerError(f"the gateway's answer holds no proper roots: {error}") from error
    kept = [root for root in roots if root in known or any(_vouches(one, root, known) for one in said)]
    return "".join(root.public_bytes(serialization.Encoding.PEM).decode() for root in kept)


def _vouches(voucher: x509.Certificate, root: x509.Certificate, known: list[x509.Certificate]) -> bool:
    try:
        if voucher.extensions.get_extension_for_class(x509.BasicConstraints).value.ca:
            return False
        if (voucher.subject, voucher.public_key()) != (root.subject, root.public_key()):
            return False
        _signed(voucher, known)
    except (ValueError, TypeError, UnsupportedAlgorithm, EnrolAnswerError, *UNREADABLE):
        return False
    return True


def _check_chain(leaf: x509.Certificate, rest: list[x509.Certificate], roots: list[x509.Certificate]) -> None:
    """From the leaf along the given order to a root that signed the last one."""
    current = leaf
    for issuer in rest:
        if issuer in roots:
            break
        _signed(current, [issuer])
        current = issuer
    _signed(current, roots)


def _signed(certificate: x509.Certificate, issuers: list[x509.Certificate]) -> None:
    for issuer in issuers:
        try:
            certificate.verify_directly_issued_by(issuer)
        except (ValueError, TypeError, InvalidSignature):
            continue
        return
    raise EnrolAnswerError("the gateway's certificate does not lead to the fleet's root")
