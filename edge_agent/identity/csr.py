"""The request for a certificate: a public key, who asks for it, and the proof that he holds its other half."""

from __future__ import annotations

from cryptography import x509
from cryptography.hazmat.primitives import hashes, serialization
from cryptography.x509.oid import NameOID

from edge_agent.identity.key import PrivateKey

__all__ = ["csr_der", "csr_pem", "make_csr", "robot_uri"]


def robot_uri(fleet: str, robot_id: str) -> str:
    """The name that a robot's certificate carries."""
    return f"spiffe://{fleet}/robot/{robot_id}"


def make_csr(key: PrivateKey, *, fleet: str, robot_id: str) -> x509.CertificateSigningRequest:
    """The request. It asks for the robot's name and nothing else: what a certificate may do, the gateway says."""
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, robot_id)])
    names = x509.SubjectAlternativeName([x509.UniformResourceIdentifier(robot_uri(fleet, robot_id))])
    builder = x509.CertificateSigningRequestBuilder().subject_name(subject).add_extension(names, critical=False)
    return builder.sign(key, hashes.SHA256())


def csr_pem(request: x509.CertificateSigningRequest) -> str:
    """As it is sent."""
    return request.public_bytes(serialization.Encoding.PEM).decode()


def csr_der(request: x509.CertificateSigningRequest) -> bytes:
    """As the old key signs it at a renewal."""
    return request.public_bytes(serialization.Encoding.DER)
