"""A proof holds for its own challenge, robot, session, lane and fleet, and for nothing else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from cryptography.hazmat.primitives.asymmetric import ec, ed25519, rsa

from metaros.link.proof import link_statement, renew_statement, sign, verify

HELLO: dict[str, Any] = {"robot_id": "arm", "session_id": b"s" * 16, "session_number": 7, "lane": 1}
KEYS: dict[str, Callable[[], Any]] = {
    "P-256": lambda: ec.generate_private_key(ec.SECP256R1()),
    "P-384": lambda: ec.generate_private_key(ec.SECP384R1()),
    "Ed25519": ed25519.Ed25519PrivateKey.generate,
}


@pytest.mark.parametrize("kind", KEYS)
def test_a_signature_is_its_keys_alone(kind: str) -> None:
    key, other = KEYS[kind](), KEYS[kind]()
    text = link_statement(b"n" * 32, audience="fleet", **HELLO)
    signature = sign(key, text)
    assert verify(key.public_key(), text, signature)
    assert not verify(other.public_key(), text, signature)
    assert not verify(key.public_key(), text, signature[:-1])
    assert not verify(key.public_key(), text, b"")


def test_every_part_of_a_hello_is_bound() -> None:
    texts = [
        link_statement(b"n" * 32, audience="fleet", **HELLO),
        link_statement(b"m" * 32, audience="fleet", **HELLO),
        link_statement(b"n" * 32, audience="other", **HELLO),
        link_statement(b"n" * 32, audience="fleetarm", **{**HELLO, "robot_id": ""}),
        *(
            link_statement(b"n" * 32, audience="fleet", **{**HELLO, name: value})
            for name, value in (("robot_id", "leg"), ("session_id", b"t" * 16), ("session_number", 8), ("lane", 2))
        ),
        renew_statement(b"n" * 32, audience="fleet", robot_id="arm", csr_der=b"csr"),
        renew_statement(b"n" * 32, audience="fleet", robot_id="ar", csr_der=b"mcsr"),
    ]
    assert len(set(texts)) == len(texts)


def test_a_challenge_has_its_size() -> None:
    with pytest.raises(ValueError, match="32 bytes"):
        link_statement(b"n" * 31, audience="fleet", **HELLO)


def test_other_kinds_of_keys_are_no_robots() -> None:
    key = rsa.generate_private_key(public_exponent=65537, key_size=2048)
    with pytest.raises(TypeError, match="P-256"):
        sign(key, b"text")
    secp256k1 = ec.generate_private_key(ec.SECP256K1())
    assert not verify(secp256k1.public_key(), b"text", secp256k1.sign(b"text", ec.ECDSA(_sha256())))


def _sha256() -> Any:
    from cryptography.hazmat.primitives import hashes

    return hashes.SHA256()
