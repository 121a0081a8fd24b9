"""Requests for certificates as an attacker writes them: names that look alike, rights, and keys that cost work."""

from __future__ import annotations

import base64
import ipaddress
from collections.abc import Callable

import pytest
from cryptography import x509
from cryptography.hazmat.primitives.asymmetric import dsa, ec, ed448, rsa, x448, x25519
from cryptography.hazmat.primitives.hashes import SHA256
from cryptography.hazmat.primitives.serialization import Encoding, NoEncryption, PrivateFormat, PublicFormat
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from gateway.errors import IdentityError
from gateway.identity.certificates.parsing import check_csr, robot_uri
from tests.gateway.identity.robot_keys import ask, new_key, pem_of

pytestmark = pytest.mark.integration

URI = robot_uri("fleet", "arm")
HUGE = (1 << 16_383) | (1 << 9_999) | 1  # an odd number as long as a modulus of RSA-16384


def refusal(pem: str) -> str:
    """Why it is refused, which it must be, by name."""
    with pytest.raises(IdentityError) as refused:
        check_csr(pem, fleet="fleet", robot="arm")
    assert refused.value.code == "csr_refused"
    return str(refused.value)


def tlv(tag: int, *parts: bytes) -> bytes:
    """A DER value."""
    body = b"".join(parts)
    if len(body) < 128:
        return bytes([tag, len(body)]) + body
    size = len(body).to_bytes((len(body).bit_length() + 7) // 8, "big")
    return bytes([tag, 0x80 | len(size)]) + size + body


def written(key: bytes, *, algorithm: bytes = b"\x2a\x86\x48\x86\xf7\x0d\x01\x01\x0b", signature: bytes = b"") -> str:
    """A request by hand, for a key (SubjectPublicKeyInfo) that nobody can sign with; sha256WithRSA unless told."""
    name = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "arm")]).public_bytes()
    asked = tlv(0x30, tlv(0x02, b"\0"), name, key, tlv(0xA0))
    body = tlv(0x30, asked, tlv(0x30, tlv(0x06, algorithm)), tlv(0x03, b"\0" + (signature or b"s" * 256)))
    return pem_text(body)


def pem_text(der: bytes) -> str:
    """DER as a PEM request."""
    return f"-----BEGIN CERTIFICATE REQUEST-----\n{base64.encodebytes(der).decode()}-----END CERTIFICATE REQUEST-----\n"


def spki(key: object) -> bytes:
    """A public key's bytes."""
    return bytes(key.public_bytes(Encoding.DER, PublicFormat.SubjectPublicKeyInfo))  # type: ignore[attr-defined]


LOOK_ALIKES = (
    *(
        f"{URI}.",
        f"{URI}/",
        f"{URI}%00",
        f"{URI}\0",
        f"{URI}#x",
        f"{URI}?x",
        f" {URI}",
        f"{URI} ",
        URI.replace("arm", "*"),
    ),
    *(URI.replace("arm", "ARM"), URI.replace("arm", "a%72m"), URI.replace("spiffe", "SPIFFE"), "spiffe://*/robot/arm"),
    *(
        URI.replace("fleet", "fleet@evil"),
        URI.replace("fleet", "fleet:443"),
        URI.replace("/robot/", "/robot//"),
        "arm",
        "",
    ),
    *("spiffe://fleet/robot/../robot/arm", "spiffe://fleet/gateway/arm", URI + "\n" + URI),
)


@pytest.mark.parametrize("name", LOOK_ALIKES, ids=range(len(LOOK_ALIKES)))
def test_a_name_that_looks_like_the_robots_is_refused(name: str) -> None:
    refusal(ask(new_key(), x509.SubjectAlternativeName([x509.UniformResourceIdentifier(name)])))


@pytest.mark.parametrize(
    "names",
    [
        [x509.UniformResourceIdentifier(URI), x509.UniformResourceIdentifier(URI)],
        [x509.UniformResourceIdentifier(URI), x509.RFC822Name("arm@fleet")],
        [x509.DNSName("*.fleet")],
        [x509.IPAddress(ipaddress.ip_address("127.0.0.1"))],
        [x509.RegisteredID(x509.ObjectIdentifier("1.2.3"))],
        [x509.DirectoryName(x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "root")]))],
        [x509.OtherName(x509.ObjectIdentifier("1.2.3"), b"\x05\x00")],
    ],
    ids=["twice", "email", "wildcard", "address", "id", "directory", "other"],
)
def test_other_kinds_of_names_are_refused(names: list[x509.GeneralName]) -> None:
    assert "asks for the name" in refusal(ask(new_key(), x509.SubjectAlternativeName(names)))


RIGHTS: dict[str, x509.ExtensionType] = {
    "CA:TRUE": x509.BasicConstraints(ca=True, path_length=3),
    "extendedKeyUsage": x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH, ExtendedKeyUsageOID.CLIENT_AUTH]),
    "nameConstraints": x509.NameConstraints([x509.UniformResourceIdentifier("fleet")], None),
    "keyUsage": x509.KeyUsage(True, True, True, True, True, True, True, False, False),
    "authorityInfoAccess": x509.AuthorityInformationAccess(
        [
            x509.AccessDescription(
                x509.ObjectIdentifier("1.3.6.1.5.5.7.48.1"), x509.UniformResourceIdentifier("http://x")
            )
        ]
    ),
    "TLSFeature": x509.TLSFeature([x509.TLSFeatureType.status_request]),
}


@pytest.mark.parametrize("asked", RIGHTS)
def test_rights_are_refused_by_name(asked: str) -> None:
    assert asked in refusal(ask(new_key(), RIGHTS[asked], uri=URI))


KEYS: dict[str, Callable[[], bytes]] = {
    "RSA of 16384 bits": lambda: spki(rsa.RSAPublicNumbers(2**64 - 59, HUGE).public_key()),
    "RSA of 1024 bits": lambda: spki(rsa.RSAPublicNumbers(3, (1 << 1023) | 1).public_key()),
    "DSA": lambda: spki(dsa.generate_private_key(1024).public_key()),
    "Ed448": lambda: spki(ed448.Ed448PrivateKey.generate().public_key()),
    "X25519": lambda: spki(x25519.X25519PrivateKey.generate().public_key()),
    "X448": lambda: spki(x448.X448PrivateKey.generate().public_key()),
    "P-521": lambda: spki(ec.generate_private_key(ec.SECP521R1()).public_key()),
    "P-224": lambda: spki(ec.generate_private_key(ec.SECP224R1()).public_key()),
}


@pytest.mark.parametrize("kind", KEYS)
def test_other_keys_are_refused_before_their_signature_is_looked_at(kind: str) -> None:
    assert "P-256, P-384 or Ed25519" in refusal(written(KEYS[kind]()))


def test_nonsense_for_a_key_is_refused() -> None:
    for key in (b"", tlv(0x30), tlv(0x30, tlv(0x30, tlv(0x06, b"\x2a\x03")), tlv(0x03, b"\0abc")), spki_of_nowhere()):
        refusal(written(key))
    refusal(written(spki(new_key().public_key()), algorithm=b"\x2a\x03\x04"))  # signed by nobody knows what
    refusal(written(spki(new_key().public_key())))  # an EC key whose signature says it is RSA's


def spki_of_nowhere() -> bytes:
    """A key of P-256 that is no point of it."""
    real = bytearray(spki(new_key().public_key()))
    real[-1] ^= 1
    return bytes(real)


def test_a_request_is_sent_alone() -> None:
    key = new_key()
    secret = key.private_bytes(Encoding.PEM, PrivateFormat.PKCS8, NoEncryption()).decode()
    for text in (ask(key) + ask(new_key()), ask(key) + secret, secret + ask(key)):
        said = refusal(text)
        assert "alone" in said
        assert secret.splitlines()[1] not in said


def test_too_much_is_refused_unread() -> None:
    assert "16384 bytes" in refusal(ask(new_key()) + " " * 16_384)
    names = [x509.UniformResourceIdentifier(f"{URI}{'x' * 50}{number}") for number in range(150)]
    assert len(refusal(ask(new_key(), x509.SubjectAlternativeName(names)))) < 1000


def test_the_subject_is_nothing_but_noise() -> None:
    subject = x509.Name([x509.NameAttribute(NameOID.COMMON_NAME, "<script>\n\x1b[31m' OR 1=1 --")])
    key = new_key()
    request = x509.CertificateSigningRequestBuilder().subject_name(subject).sign(key, SHA256())
    assert check_csr(pem_of(request), fleet="fleet", robot="arm")[0] == key.public_key()
