"""The enrolment token, and the pin in it: by which the robot knows the fleet's root before it trusts anything.

A token is `mr1.<id>.<secret>.<pin>`. The pin is the SHA-256 of the root's SubjectPublicKeyInfo; whoever gave the token
to the robot has thereby named the right gateway.
"""

from __future__ import annotations

import base64
import hashlib
import hmac
import re
from dataclasses import dataclass, field

from cryptography import x509
from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization

from edge_agent.errors import PinError, TokenFormatError

__all__ = ["Token", "parse_token", "pinned_roots", "spki_pin"]

MOST_ROOTS = 8

_TOKEN = re.compile(r"mr1\.([A-Za-z0-9_-]{1,64})\.([0-9a-f]{32})\.([A-Za-z0-9_-]{43})")


@dataclass(frozen=True, slots=True)
class Token:
    """A one-time enrolment token, taken apart. `text` holds the secret and is not shown."""

    id: str
    pin: str
    text: str = field(repr=False)


def parse_token(text: str) -> Token:
    """Read a token. Raises TokenFormatError, which does not repeat it."""
    text = text.strip()
    match = _TOKEN.fullmatch(text)
    if match is None:
        raise TokenFormatError("that is no enrolment token: one has the form mr1.ID.SECRET.PIN, in one piece")
    return Token(match[1], match[3], text)


def spki_pin(certificate: x509.Certificate) -> str:
    """SHA-256 of the certificate's public key, base64url without padding."""
    key = certificate.public_key()
    spki = key.public_bytes(serialization.Encoding.DER, serialization.PublicFormat.SubjectPublicKeyInfo)
    return base64.urlsafe_b64encode(hashlib.sha256(spki).digest()).rstrip(b"=").decode()


def pinned_roots(pem: bytes, pin: str) -> bytes:
    """Those of the certificates that have the pinned key, as PEM. Raises PinError where none has."""
    try:
        certificates = x509.load_pem_x509_certificates(pem)
        found = [item for item in certificates[:MOST_ROOTS] if hmac.compare_digest(spki_pin(item), pin)]
    except (ValueError, UnsupportedAlgorithm) as error:  # also of a key that is none, in a certificate that is one
        raise PinError("what is there showed no root certificate") from error
    if not found:
        raise PinError("what is there is not the gateway that this token is of: its root has another key")
    return b"".join(item.public_bytes(serialization.Encoding.PEM) for item in found)
