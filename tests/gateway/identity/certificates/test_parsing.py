"""Requests for certificates: the robot's own name or nothing; whatever else is asked for is refused by name."""

from __future__ import annotations

import base64

import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID

from gateway.errors import IdentityError
from gateway.identity.certificates.parsing import check_csr, key_id, load_certificate, robot_uri
from tests.gateway.identity.robot_keys import KEYS, ask, der, new_key

URI = robot_uri("fleet", "arm")


def refusal(pem: str) -> str:
    with pytest.raises(IdentityError) as refused:
        check_csr(pem, fleet="fleet", robot="arm")
    assert refused.value.code == "csr_refused"
    return str(refused.value)


@pytest.mark.parametrize("kind", ["P-256", "P-384", "Ed25519"])
@pytest.mark.parametrize("uri", ["", URI])
def test_a_key_of_these_kinds_is_certified(kind: str, uri: str) -> None:
    key = KEYS[kind]()
    pem = ask(key, uri=uri)
    found, request = check_csr(pem, fleet="fleet", robot="arm")
    assert found == key.public_key()
    assert request == der(pem)
    assert len(key_id(found)) == 64


@pytest.mark.parametrize("kind", ["secp256k1", "RSA"])
def test_other_keys_are_refused(kind: str) -> None:
    assert "P-256, P-384 or Ed25519" in refusal(ask(KEYS[kind]()))


@pytest.mark.parametrize("asked", [True, False])
def test_authority_is_refused_by_name(asked: bool) -> None:
    pem = ask(new_key(), x509.BasicConstraints(ca=asked, path_length=None), uri=URI)
    assert f"CA:{str(asked).upper()}" in refusal(pem)


def test_another_name_is_refused_by_name() -> None:
    for uri in (robot_uri("fleet", "leg"), robot_uri("other", "arm"), URI + "/x", URI.upper()):
        assert uri in refusal(ask(new_key(), uri=uri))
    two = x509.SubjectAlternativeName([x509.UniformResourceIdentifier(URI), x509.DNSName("gateway")])
    assert "gateway" in refusal(ask(new_key(), two))
    dns = x509.SubjectAlternativeName([x509.DNSName(URI)])
    assert URI in refusal(ask(new_key(), dns))


def test_other_extensions_are_refused_by_name() -> None:
    assert "extendedKeyUsage" in refusal(ask(new_key(), x509.ExtendedKeyUsage([ExtendedKeyUsageOID.SERVER_AUTH])))
    unknown = x509.UnrecognizedExtension(x509.ObjectIdentifier("1.2.3.4.5"), b"\x05\x00")
    assert "1.2.3.4.5" in refusal(ask(new_key(), unknown))


def test_a_request_that_another_key_signed_is_refused() -> None:
    raw = bytearray(der(ask(new_key(), uri=URI)))
    other = new_key().public_key()
    mine = raw.find(b"\x03\x42\x00\x04")  # the point of the public key
    raw[mine + 4 : mine + 68] = other.public_numbers().x.to_bytes(32, "big") + other.public_numbers().y.to_bytes(
        32, "big"
    )
    assert "not signed" in refusal(_pem(bytes(raw)))


def test_every_cut_and_many_flips_are_refused_or_read() -> None:
    raw = der(ask(new_key(), uri=URI))
    for end in range(len(raw)):
        assert refusal(_pem(raw[:end]))
    for place in range(len(raw)):
        flipped = bytearray(raw)
        flipped[place] ^= 0x55
        assert refusal(_pem(bytes(flipped)))


def test_text_that_is_nothing_is_refused() -> None:
    for text in ("", "x", "-----BEGIN CERTIFICATE REQUEST-----\n-----END CERTIFICATE REQUEST-----", "A" * 20_000):
        assert refusal(text)
        with pytest.raises(IdentityError) as refused:
            load_certificate(text)
        assert refused.value.code == "certificate_foreign"


def _pem(raw: bytes) -> str:
    body = base64.encodebytes(raw).decode()
    return f"-----BEGIN CERTIFICATE REQUEST-----\n{body}-----END CERTIFICATE REQUEST-----\n"
