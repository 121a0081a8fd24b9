"""The key is on P-256 and survives its text; the request names the robot and asks for nothing else."""

from __future__ import annotations

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric import ec, rsa

from edge_agent.errors import IdentityFileError
from edge_agent.identity.csr import csr_der, csr_pem, make_csr
from edge_agent.identity.key import key_from_pem, key_to_pem, new_key, public_der


def test_a_key_survives_its_text() -> None:
    key = new_key()
    assert public_der(key_from_pem(key_to_pem(key))) == public_der(key)
    assert public_der(key) != public_der(new_key())


@pytest.mark.parametrize("kind", ["rsa", "p384", "garbage"])
def test_other_keys_are_refused(kind: str) -> None:
    made = {
        "rsa": lambda: rsa.generate_private_key(65537, 2048),
        "p384": lambda: ec.generate_private_key(ec.SECP384R1()),
    }
    text = "nonsense"
    if kind in made:
        plain = serialization.NoEncryption()
        text = made[kind]().private_bytes(serialization.Encoding.PEM, serialization.PrivateFormat.PKCS8, plain).decode()
    with pytest.raises(IdentityFileError):
        key_from_pem(text)


def test_a_request_names_the_robot_and_nothing_else() -> None:
    key = new_key()
    request = make_csr(key, fleet="f00", robot_id="arm_1")
    read = x509.load_pem_x509_csr(csr_pem(request).encode())
    assert read.is_signature_valid
    assert csr_der(read) == csr_der(request)
    assert [type(item.value) for item in read.extensions] == [x509.SubjectAlternativeName]
    names = read.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert [str(name.value) for name in names] == ["spiffe://f00/robot/arm_1"]
