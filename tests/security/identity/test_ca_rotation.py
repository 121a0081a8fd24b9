"""A new root under a gateway that speaks TLS: the agent's own code, over the old root, both, and the new one."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest
from cryptography import x509

from edge_agent.errors import EnrolError, EnrolRefusedError
from edge_agent.identity.certificate import vouched_roots
from edge_agent.identity.enrol import renew
from edge_agent.identity.enrolment_token import spki_pin
from edge_agent.identity.files import IdentityFiles, RobotIdentity
from gateway.identity import manager, robots
from gateway.identity.certificates.ca import make_intermediate, make_root, pem, voucher
from gateway.identity.certificates.rotation import retire, rotate_root, settle
from gateway.main import Ready
from gateway.store.engines import open_engine
from gateway.store.ledger import in_transaction
from metaros.clock import SystemClock
from tests.gateway.harness import running_gateway
from tests.security.identity.test_enrolment import RING, carries, enrol_robot, linked
from tests.support.robots.uplinks import wait
from tests.support.servers.certificates import make_certificate
from tests.support.servers.nginx import Nginx, nginx_program

NOW_NS = SystemClock().wall_ns()


@pytest.fixture(autouse=True)
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    """The gateway looks often at what another process wrote."""
    monkeypatch.setattr(robots, "POLL_S", 0.05)
    monkeypatch.setattr(manager, "FOLLOW_S", 0.05)


def work(ready: Ready, *, retiring: bool) -> None:
    """`metaros ca rotate --root` or `metaros ca retire --force` on the data directory of a gateway that runs."""
    engine, _ = open_engine("", ready.data_dir)
    try:
        run, now_ns = in_transaction(engine), SystemClock().wall_ns()
        if retiring:
            run(lambda engine: retire(engine, now_ns=now_ns, force=True))
        else:
            run(lambda engine: rotate_root(engine, ready.data_dir, now_ns=now_ns))
        run(lambda engine: settle(engine, ready.data_dir))
    finally:
        engine.close()


async def renewed(identity: RobotIdentity, state: Path) -> RobotIdentity:
    """What the agent does when its certificate is due."""
    return await asyncio.to_thread(renew, identity, state)


def roots(identity: RobotIdentity) -> list[str]:
    """Pins of what the robot trusts."""
    return [spki_pin(root) for root in x509.load_pem_x509_certificates(identity.roots.encode())]


async def comes_to_trust(count: int, identity: RobotIdentity, state: Path, *, old: RobotIdentity) -> RobotIdentity:
    """Renew until the gateway has noticed: then so many roots are trusted, on the disk, too, and another issuer has
    signed than `old`'s. A renewal in the moment of the change is the old one's, whom retiring by force cuts off.
    """
    held = [identity]

    async def reached() -> bool:
        try:
            held.append(await renewed(held[-1], state))
        except EnrolError as error:
            if type(error) is not EnrolError:  # it was refused, or one of the two does not believe the other
                raise
            return False  # a handshake in the moment of the change may break off; agents try again, too
        return len(roots(held[-1])) == count and held[-1].chain != old.chain

    async with asyncio.timeout(60):
        while not await reached():  # noqa: ASYNC110
            await asyncio.sleep(0.05)
    assert IdentityFiles(state).load() == held[-1]
    return held[-1]


@pytest.mark.integration
async def test_over_tls_a_robot_passes_from_one_root_to_the_next_and_keeps_its_link(tmp_path: Path) -> None:
    state = tmp_path / "robot"
    async with running_gateway(tmp_path, authenticator=RING, tls="on", require_enrolment=True) as ready:
        first = await enrol_robot(ready, state)
        (old,) = roots(first)
        async with linked(first, "grpc") as (owner, uplink):
            await carries(owner, uplink)
            await asyncio.to_thread(work, ready, retiring=False)
            second = await comes_to_trust(2, first, state, old=first)
            assert old in roots(second)
            await carries(owner, uplink)  # the link of before lives on
        async with linked(first, "grpc") as (owner, uplink):
            await carries(owner, uplink)  # who knows the old root alone connects, still
        async with linked(second, "grpc") as (owner, uplink):
            await carries(owner, uplink)
        await asyncio.to_thread(work, ready, retiring=True)
        third = await comes_to_trust(1, second, state, old=first)
        assert roots(third) != [old]
        for transport in ("grpc", "websocket"):
            async with linked(third, "grpc" if transport == "grpc" else "websocket") as (owner, uplink):
                await carries(owner, uplink)
        with pytest.raises(EnrolError):  # it does not believe the gateway any more, nor the gateway it
            await renewed(first, tmp_path / "left behind")


@pytest.mark.integration
async def test_behind_a_proxy_of_somebody_elses_a_new_root_comes_with_the_old_ones_signature(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    nginx_program()
    certificate, state = make_certificate(tmp_path), tmp_path / "robot"
    monkeypatch.setenv("SSL_CERT_FILE", str(certificate))
    async with running_gateway(tmp_path, authenticator=RING, require_enrolment=True) as ready:
        with Nginx(tmp_path / "nginx", ready.http_port, "/fleet", certificate) as nginx:
            first = await enrol_robot(ready, state, url=nginx.url)
            assert first.system_trust
            await asyncio.to_thread(work, ready, retiring=False)
            second = await comes_to_trust(2, first, state, old=first)
            await asyncio.to_thread(work, ready, retiring=True)
            third = await comes_to_trust(1, second, state, old=first)
            assert roots(third) != roots(first)
            async with linked(third, "websocket") as (owner, uplink):
                await carries(owner, uplink)
            with pytest.raises(EnrolRefusedError, match="certificate_foreign"):
                await renewed(first, tmp_path / "left behind")


async def test_a_link_of_a_retired_issuer_is_cut(tmp_path: Path) -> None:
    async with running_gateway(tmp_path, authenticator=RING, tls="on", require_enrolment=True) as ready:
        identity = await enrol_robot(ready, tmp_path)
        async with linked(identity, "grpc") as (owner, uplink):
            await carries(owner, uplink)
            await asyncio.to_thread(work, ready, retiring=False)
            await asyncio.to_thread(work, ready, retiring=True)
            await wait(lambda: owner.errors)


def test_a_new_root_is_vouched_for_by_a_trusted_root_and_by_nothing_less() -> None:
    (old, old_key), (new, _), (third, third_key) = (make_root("fleet", now_ns=NOW_NS) for _ in range(3))
    said = voucher(new, old, old_key, now_ns=NOW_NS)
    both = pem(old, new)
    assert vouched_roots(pem(old), both, pem(said)) == both
    assert vouched_roots(pem(old), both, "") == pem(old)
    assert vouched_roots(pem(old), pem(new), pem(voucher(new, third, third_key, now_ns=NOW_NS))) == ""
    assert vouched_roots(pem(old), pem(third), pem(said)) == ""  # it is of another key
    # Whoever has an issuer's key makes a root of it. The issuer's own certificate is no voucher.
    issuer = make_intermediate("fleet", old, old_key, now_ns=NOW_NS)
    assert issuer.key is not None
    posing = _self_signed(issuer.certificate, issuer.key)
    assert vouched_roots(pem(old), pem(posing), pem(issuer.certificate)) == ""
    with pytest.raises(EnrolError):
        vouched_roots(pem(old), "no PEM", "")


def _self_signed(issuer: x509.Certificate, key: object) -> x509.Certificate:
    from cryptography.hazmat.primitives import hashes
    from cryptography.hazmat.primitives.asymmetric import ec

    assert isinstance(key, ec.EllipticCurvePrivateKey)
    draft = x509.CertificateBuilder().subject_name(issuer.subject).issuer_name(issuer.subject)
    draft = draft.public_key(key.public_key()).serial_number(x509.random_serial_number())
    draft = draft.not_valid_before(issuer.not_valid_before_utc).not_valid_after(issuer.not_valid_after_utc)
    return draft.add_extension(x509.BasicConstraints(True, None), critical=True).sign(key, hashes.SHA256())
