"""The authority: what it issues holds, and what it does not issue is recognised as nobody's."""

from __future__ import annotations

import ssl
from datetime import timedelta
from pathlib import Path

import pytest
from cryptography import x509
from cryptography.hazmat.primitives import hashes
from cryptography.hazmat.primitives.asymmetric import ec
from cryptography.x509.oid import ExtendedKeyUsageOID
from cryptography.x509.verification import PolicyBuilder, Store

from gateway.errors import IdentityError
from gateway.identity.certificates.ca import (
    Authority,
    issue_robot,
    issue_server,
    key_pem,
    make_intermediate,
    make_root,
    pem,
    supplied,
)
from gateway.identity.certificates.parsing import load_certificate, read_robot, robot_uri
from metaros.clock import SystemClock
from metaros.errors import ConfigError
from tests.gateway.identity.robot_keys import KEYS, new_key

NOW = SystemClock().wall_ns()
DAY = 86_400.0


def make_authority(fleet: str = "fleet", *, now_ns: int = NOW) -> Authority:
    return make_intermediate(fleet, *make_root(fleet, now_ns=now_ns), now_ns=now_ns)


def issued(authority: Authority, *, robot: str = "arm", fleet: str = "fleet", life_s: float = DAY) -> x509.Certificate:
    return issue_robot(authority, new_key().public_key(), fleet=fleet, robot=robot, now_ns=NOW, life_s=life_s)


def after(seconds: float) -> int:
    return NOW + round(seconds * 1e9)


@pytest.mark.parametrize("kind", ["P-256", "P-384", "Ed25519"])
def test_a_robots_certificate_is_read_again(kind: str) -> None:
    authority, key = make_authority(), KEYS[kind]().public_key()
    made = issue_robot(authority, key, fleet="fleet", robot="arm", now_ns=NOW, life_s=7 * DAY)
    read = read_robot(load_certificate(pem(made)), [authority.certificate], fleet="fleet", now_ns=NOW)
    assert (read.robot, read.key, read.serial) == ("arm", key, f"{made.serial_number:x}")
    assert 6.9 * DAY < (read.not_after_ns - NOW) / 1e9 <= 7 * DAY
    assert 299 < (NOW - read.not_before_ns) / 1e9 < 302  # a robot's clock may be five minutes behind


def test_a_robots_certificate_passes_a_strict_verifier() -> None:
    authority = make_authority()
    verifier = PolicyBuilder().store(Store([authority.root])).build_client_verifier()
    verified = verifier.verify(issued(authority), [authority.certificate])
    assert verified.subjects is not None
    assert [name.value for name in verified.subjects] == [robot_uri("fleet", "arm")]


def test_who_is_nobodys_is_foreign() -> None:
    authority, other = make_authority(), make_authority()
    foreign = {
        "another authority of the same names": issued(other),
        "another fleet": issued(authority, fleet="another"),
        "an authority itself": authority.certificate,
        "a server of ours": load_certificate(issue_server(authority, ["localhost"], now_ns=NOW).chain_pem),
    }
    for certificate in foreign.values():
        with pytest.raises(IdentityError) as refused:
            read_robot(certificate, [authority.certificate], fleet="fleet", now_ns=NOW)
        assert refused.value.code == "certificate_foreign"


def test_a_certificate_that_a_robot_issued_with_its_own_is_foreign() -> None:
    authority, key = make_authority(), new_key()
    robot = issue_robot(authority, key.public_key(), fleet="fleet", robot="arm", now_ns=NOW, life_s=DAY)
    forged = issued(Authority(authority.root, robot, key), robot="leg")
    with pytest.raises(IdentityError) as refused:
        read_robot(forged, [authority.certificate], fleet="fleet", now_ns=NOW)
    assert refused.value.code == "certificate_foreign"


def test_its_time_ends_and_grace_forgives_only_so_much() -> None:
    authority = make_authority()
    made = issued(authority)

    def code(at_s: float, grace_s: float = 0.0) -> str:
        try:
            read_robot(made, [authority.certificate], fleet="fleet", now_ns=after(at_s), grace_s=grace_s)
        except IdentityError as error:
            return error.code
        return ""

    assert code(DAY - 2) == ""
    assert code(DAY + 1) == "certificate_expired"
    assert code(30 * DAY, 30 * DAY) == ""
    assert code(31 * DAY + 1, 30 * DAY) == "certificate_expired"
    assert code(-400, 30 * DAY) == "certificate_expired"


def test_nothing_outlives_its_issuer() -> None:
    root, key = make_root("fleet", now_ns=NOW)
    late = after(3640 * DAY)
    authority = make_intermediate("fleet", root, key, now_ns=late)
    assert authority.certificate.not_valid_after_utc == root.not_valid_after_utc
    robot = issue_robot(authority, new_key().public_key(), fleet="f", robot="a", now_ns=late, life_s=365 * DAY)
    assert robot.not_valid_after_utc == root.not_valid_after_utc


def test_a_tls_client_that_knows_the_root_believes_the_server(tmp_path: Path) -> None:
    authority = make_authority()
    pair = issue_server(authority, ["gateway.example", "127.0.0.1", "::1"], now_ns=NOW)
    (tmp_path / "chain.pem").write_bytes(pair.chain_pem)
    (tmp_path / "key.pem").write_bytes(pair.key_pem)
    context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
    context.load_cert_chain(tmp_path / "chain.pem", tmp_path / "key.pem")
    for name in ("gateway.example", "127.0.0.1", "::1"):
        assert handshake(context, pem(authority.root), name) == ""
    assert "mismatch" in handshake(context, pem(authority.root), "other.example")
    assert "verify failed" in handshake(context, pem(make_authority().root), "gateway.example")


def handshake(server: ssl.SSLContext, roots: str, name: str) -> str:
    """What a client says of the server, in memory."""
    client = ssl.create_default_context(cadata=roots)
    up, down = ssl.MemoryBIO(), ssl.MemoryBIO()
    ends = [client.wrap_bio(down, up, server_hostname=name), server.wrap_bio(up, down, server_side=True)]
    for _ in range(4):
        for end in ends:
            try:
                end.do_handshake()
            except ssl.SSLWantReadError:
                continue
            except ssl.SSLError as error:
                return str(error)
    return ""


def test_a_supplied_issuer_is_used_as_it_is() -> None:
    made = make_authority()
    assert made.key is not None
    authority = supplied(pem(made.certificate, made.root).encode(), key_pem(made.key), now_ns=NOW)
    assert authority.pin == made.pin
    read = read_robot(issued(authority), [authority.certificate], fleet="fleet", now_ns=NOW)
    assert read.robot == "arm"
    assert authority.chain_pem == pem(made.certificate)


def test_a_supplied_root_may_issue_by_itself() -> None:
    root, key = make_root("fleet", now_ns=NOW)
    authority = supplied(pem(root).encode(), key_pem(key), now_ns=NOW)
    assert authority.chain_pem == ""
    assert read_robot(issued(authority), [authority.certificate], fleet="fleet", now_ns=NOW).robot == "arm"


def test_what_cannot_issue_is_refused_with_the_reason() -> None:
    made, other = make_authority(), make_authority()
    assert made.key is not None
    assert other.key is not None
    key = new_key()
    leaf = issue_robot(made, key.public_key(), fleet="fleet", robot="arm", now_ns=NOW, life_s=DAY)
    whole = pem(made.certificate, made.root).encode()
    cases = {
        "not PEM": (b"nothing", key_pem(made.key), NOW),
        "not the key of": (whole, key_pem(other.key), NOW),
        "no certificate authority": (pem(leaf, made.certificate, made.root).encode(), key_pem(key), NOW),
        "not issued by": (pem(made.certificate, other.root).encode(), key_pem(made.key), NOW),
        "valid until": (whole, key_pem(made.key), after(1100 * DAY)),
    }
    for said, (certificates, private, now_ns) in cases.items():
        with pytest.raises(ConfigError, match=said):
            supplied(certificates, private, now_ns=now_ns)


def test_a_certificate_with_two_names_or_other_uses_is_foreign() -> None:
    authority = make_authority()
    assert isinstance(authority.key, ec.EllipticCurvePrivateKey)
    uri = x509.UniformResourceIdentifier(robot_uri("fleet", "arm"))
    client, server = ExtendedKeyUsageOID.CLIENT_AUTH, ExtendedKeyUsageOID.SERVER_AUTH
    for names, usages in (([uri, x509.DNSName("leg")], [client]), ([uri], [client, server]), ([uri], [server])):
        now = authority.certificate.not_valid_before_utc
        made = (
            x509.CertificateBuilder()
            .subject_name(x509.Name([]))
            .issuer_name(authority.certificate.subject)
            .public_key(new_key().public_key())
            .serial_number(7)
            .not_valid_before(now)
            .not_valid_after(now + timedelta(days=9))
            .add_extension(x509.BasicConstraints(ca=False, path_length=None), critical=True)
            .add_extension(x509.ExtendedKeyUsage(usages), critical=False)
            .add_extension(x509.SubjectAlternativeName(names), critical=False)
            .sign(authority.key, hashes.SHA256())
        )
        with pytest.raises(IdentityError) as refused:
            read_robot(made, [authority.certificate], fleet="fleet", now_ns=NOW)
        assert refused.value.code == "certificate_foreign"
