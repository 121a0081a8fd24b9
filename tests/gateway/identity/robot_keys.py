"""What a robot makes: keys and requests for certificates, honest ones and others."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa
from cryptography.x509.oid import NameOID

__all__ = ["KEYS", "ask", "der", "new_key", "pem_of"]

KEYS: dict[str, Callable[[], Any]] = {
    "P-256": lambda: ec.generate_private_key(ec.SECP256R1()),
    "P-384": lambda: ec.generate_private_key(ec.SECP384R1()),
    "Ed25519": ed25519.Ed25519PrivateKey.generate,
    "secp256k1": lambda: ec.generate_private_key(ec.SECP256K1()),
    "RSA": lambda: rsa.generate_private_key(public_exponent=65537, key_size=2048),
}


def new_key() -> Any:
    """A key as agents make them."""
    return KEYS["P-256"]()


def ask(key: Any, *extensions: x509.ExtensionType, uri: str = "") -> str:
    """A request for a certificate in PEM; `uri` is the name it asks for."""
    draft = x509.CertificateSigningRequestBuilder().subject_name(
        x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "whatever it likes")])
    )
    if uri:
        extensions += (x509.SubjectAlternativeName([x509.UniformResourceIdentifier(uri)]),)
    for extension in extensions:
        draft = draft.add_extension(extension, critical=False)
    digest = None if isinstance(key, ed25519.Ed25519PrivateKey) else hashes.SHA256()
    return pem_of(draft.sign(key, digest))


def pem_of(thing: Any) -> str:
    """A certificate or request as PEM."""
    return str(thing.public_bytes(serialization.Encoding.PEM).decode())


def der(pem: str) -> bytes:
    """A request's bytes."""
    return x509.load_pem_x509_csr(pem.encode()).public_bytes(serialization.Encoding.DER)
