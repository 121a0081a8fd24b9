"""The robot's private key: ECDSA on P-256, made on the robot, and never sent anywhere."""

from __future__ import annotations

from cryptography.exceptions import UnsupportedAlgorithm
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec

from edge_agent.errors import IdentityFileError

__all__ = ["PrivateKey", "key_from_pem", "key_to_pem", "new_key", "public_der"]

PrivateKey = ec.EllipticCurvePrivateKey

_SPKI = serialization.PublicFormat.SubjectPublicKeyInfo


def new_key() -> PrivateKey:
    """A fresh key, from the operating system's randomness."""
    return ec.generate_private_key(ec.SECP256R1())


def key_to_pem(key: PrivateKey) -> str:
    """The key as PKCS#8 PEM, unencrypted: the file's mode guards it."""
    plain = serialization.NoEncryption()
    return key.private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, plain).decode()


def key_from_pem(pem: str) -> PrivateKey:
    """Read a key. Raises IdentityFileError: no key, or not one on P-256."""
    try:
        key = serialization.load_pem_private_key(pem.encode(), password=None)
    except (ValueError, TypeError, UnsupportedAlgorithm) as error:
        raise IdentityFileError(f"no private key: {error}") from error
    if not isinstance(key, ec.EllipticCurvePrivateKey) or not isinstance(key.curve, ec.SECP256R1):
        raise IdentityFileError("the private key is not one on the curve P-256")
    return key


def public_der(key: PrivateKey) -> bytes:
    """Its public half, as SubjectPublicKeyInfo."""
    return key.public_key().public_bytes(serialization.Encoding.DER, _SPKI)
