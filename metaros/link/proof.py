"""Proof that a robot holds its key: the statements it signs, and their signatures. Both sides use the same code.

A statement begins with what it is for, and every part carries its length: a signature can neither be used elsewhere
nor be read in two ways. The fleet is part of it, so that nobody can pass a challenge on to another fleet's robot.
"""

from __future__ import annotations

from typing import Any

__all__ = ["CURVES", "NONCE_BYTES", "link_statement", "renew_statement", "sign", "verify"]

NONCE_BYTES = 32
CURVES = {"secp256r1": "SHA256", "secp384r1": "SHA384"}  # what a robot's key may be, beside Ed25519, and its digest

_LINK = b"metaros link 1"
_RENEW = b"metaros renew 1"


def link_statement(
    nonce: bytes, *, audience: str, robot_id: str, session_id: bytes, session_number: int, lane: int
) -> bytes:
    """What answers a Challenge: it binds the nonce to the fleet, the robot, the session and the lane of the Hello.

    Raises ValueError for a nonce of another size.
    """
    numbers = session_number.to_bytes(8, "big") + lane.to_bytes(4, "big")
    return _statement(_LINK, nonce, audience, robot_id.encode(), session_id, numbers)


def renew_statement(nonce: bytes, *, audience: str, robot_id: str, csr_der: bytes) -> bytes:
    """The old key's word for a certificate request with a new one. Raises ValueError for a nonce of another size."""
    return _statement(_RENEW, nonce, audience, robot_id.encode(), csr_der)


def sign(key: Any, statement: bytes) -> bytes:
    """The signature of a private key (P-256, P-384 or Ed25519); TypeError for any other kind."""
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519

    if isinstance(key, ed25519.Ed25519PrivateKey):
        return key.sign(statement)
    if isinstance(key, ec.EllipticCurvePrivateKey) and key.curve.name in CURVES:
        return key.sign(statement, ec.ECDSA(_digest(key.curve.name)))
    raise TypeError("a robot's key is P-256, P-384 or Ed25519")


def verify(key: Any, statement: bytes, signature: bytes) -> bool:
    """Whether the signature is that of the public key's owner; False for a kind of key that no robot has."""
    from cryptography.exceptions import InvalidSignature
    from cryptography.hazmat.primitives.asymmetric import ec, ed25519

    try:
        if isinstance(key, ed25519.Ed25519PublicKey):
            key.verify(signature, statement)
            return True
        if isinstance(key, ec.EllipticCurvePublicKey) and key.curve.name in CURVES:
            key.verify(signature, statement, ec.ECDSA(_digest(key.curve.name)))
            return True
    except InvalidSignature:
        pass
    return False


def _digest(curve: str) -> Any:
    from cryptography.hazmat.primitives import hashes

    return getattr(hashes, CURVES[curve])()


def _statement(purpose: bytes, nonce: bytes, audience: str, *parts: bytes) -> bytes:
    if len(nonce) != NONCE_BYTES:
        raise ValueError(f"a challenge has {NONCE_BYTES} bytes")
    everything = (purpose, nonce, audience.encode(), *parts)
    return b"".join(len(part).to_bytes(4, "big") + part for part in everything)
