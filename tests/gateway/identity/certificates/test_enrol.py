"""Enrolment and renewal, on both databases: every refusal by its name, and nothing half done."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable
from pathlib import Path
from typing import Any

import pytest
from cryptography import x509

from gateway.errors import AuthorityError, IdentityError, InvalidRequestError, TooManyError
from gateway.identity.certificates.ca import issue_robot, key_pem, make_intermediate, make_root, pem
from gateway.identity.certificates.enrol import CHALLENGE_S, EnrolManager
from gateway.identity.certificates.parsing import load_certificate, robot_uri
from gateway.identity.certificates.tokens import make_token
from metaros.limits import Limits
from tests.gateway.identity.identity_rig import DAY, Held, IdentityRig, open_identity_rig
from tests.gateway.identity.robot_keys import ask, new_key
from tests.support.servers.databases import on_both
from tests.support.servers.postgres import PostgresServer


async def code(work: Awaitable[Any]) -> str:
    """Why it is refused; "" when it is not."""
    try:
        await work
    except IdentityError as error:
        return error.code
    return ""


@on_both
async def test_a_robot_gets_its_name_and_a_day(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        token, state = await rig.enrol.make_token(made_by="ada", ttl_s=60)
        key = new_key()
        given = await rig.enrol.enrol(token.text, "arm", ask(key, uri=robot_uri("fleet", "arm")))
        leaf, issuer = load_certificate(given.certificate), load_certificate(given.chain)
        leaf.verify_directly_issued_by(issuer)
        issuer.verify_directly_issued_by(load_certificate(given.roots))
        assert leaf.public_key() == key.public_key()
        names = leaf.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
        assert [name.value for name in names] == ["spiffe://fleet/robot/arm"]
        assert abs(given.not_after_ns - rig.clock.wall_ns() - DAY * 1e9) < 2e9
        assert state.expires_ns == rig.clock.wall_ns() + 60_000_000_000
        assert token.secret not in str(await rig.enrol.tokens())


async def test_a_bad_request_leaves_the_token_good(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        token, _ = await rig.enrol.make_token(made_by="ada")
        key = new_key()
        ca = ask(key, x509.BasicConstraints(ca=True, path_length=0))
        assert await code(rig.enrol.enrol(token.text, "arm", ca)) == "csr_refused"
        other = ask(key, uri=robot_uri("fleet", "leg"))
        assert await code(rig.enrol.enrol(token.text, "arm", other)) == "csr_refused"
        with pytest.raises(InvalidRequestError):
            await rig.enrol.enrol(token.text, "../arm", ask(key))
        assert await code(rig.enrol.enrol(token.text, "arm", ask(key))) == ""


@on_both
async def test_tokens_that_are_not_good_are_refused_by_name(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        used, _ = await rig.enrol.make_token(made_by="ada")
        old, _ = await rig.enrol.make_token(made_by="ada", ttl_s=60)
        bound, _ = await rig.enrol.make_token(robot="arm", made_by="ada")
        dropped, _ = await rig.enrol.make_token(made_by="ada")
        assert await rig.enrol.drop_token(dropped.id)
        await rig.enrol.enrol(used.text, "leg", ask(new_key()))
        rig.clock.advance(61)

        async def said(text: str) -> str:
            return await code(rig.enrol.enrol(text, "head", ask(new_key())))

        assert await said(used.text) == "token_used"
        assert await said(old.text) == "token_expired"
        assert await said(bound.text) == "token_foreign"
        assert await said(make_token("A" * 43).text) == "token_foreign"  # of another fleet's root
        assert await said(dropped.text) == "token_unknown"
        assert await said("mr1.nothing") == "token_unknown"


@on_both
async def test_of_thirty_robots_at_once_one_is_enrolled(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        token, _ = await rig.enrol.make_token(made_by="ada")
        tries = (code(rig.enrol.enrol(token.text, f"r{n}", ask(new_key()))) for n in range(30))
        assert sorted(await asyncio.gather(*tries)) == ["", *["token_used"] * 29]


@on_both
async def test_a_lost_answer_is_given_again(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        token, _ = await rig.enrol.make_token(made_by="ada")
        csr = ask(new_key())
        first = await rig.enrol.enrol(token.text, "arm", csr)
        rig.clock.advance(599)
        again = await rig.enrol.enrol(token.text, "arm", csr)
        assert (again.certificate, again.fresh, first.fresh) == (first.certificate, False, True)
        rig.clock.advance(2)
        assert await code(rig.enrol.enrol(token.text, "arm", csr)) == "token_used"


@on_both
async def test_tokens_are_bounded(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        few = EnrolManager(rig.store, rig.authorities, clock=rig.clock, life_s=DAY, limits=Limits(enrolment_tokens=2))
        for _ in range(2):
            await few.make_token(made_by="ada")
        with pytest.raises(TooManyError):
            await few.make_token(made_by="ada")


async def test_renewal_on_time_and_in_grace(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held = await rig.enrolled()
        for offline_s in (0.6 * DAY, 30 * DAY, 1.0):  # never two at one instant: these have no order
            rig.clock.advance(offline_s)
            key = new_key()
            held = Held("arm", key, (await rig.renewed(held, key=key)).certificate)
        (identity,) = await rig.robots.list()
        assert [one.how for one in identity.certificates] == ["renewal", "grace", "renewal", "token"]
        rig.clock.advance(31 * DAY + 1)
        assert await code(rig.renewed(held)) == "certificate_expired"


async def test_a_renewal_is_proven(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held, other = await rig.enrolled(), await rig.enrolled("leg")
        assert await code(rig.renewed(held, signed_by=new_key())) == "proof_refused"
        assert await code(rig.renewed(held, signed_by=other.key)) == "proof_refused"
        assert await code(rig.renewed(held, nonce=b"n" * 32)) == "proof_refused"
        assert await code(rig.renewed(Held("leg", held.key, held.certificate))) == "certificate_foreign"
        assert await code(rig.renewed(held, key=held.key)) == "csr_refused"
        old = await rig.enrol.challenge()
        rig.clock.advance(CHALLENGE_S + 1)
        assert await code(rig.renewed(held, nonce=old)) == "proof_refused"
        nonce, csr = await rig.enrol.challenge(), ask(new_key())
        proof = b"\x00" * 70
        work = rig.enrol.renew("arm", nonce=nonce, certificate=held.certificate, csr=csr, proof=proof)
        assert await code(work) == "proof_refused"
        assert await code(rig.renewed(held)) == ""


@on_both
async def test_a_certificate_of_nobody_is_not_renewed(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        await rig.enrolled("leg")
        now_ns = rig.clock.wall_ns()
        stranger, key = make_intermediate("fleet", *make_root("fleet", now_ns=now_ns), now_ns=now_ns), new_key()
        forged = issue_robot(stranger, key.public_key(), fleet="fleet", robot="leg", now_ns=now_ns, life_s=DAY)
        assert await code(rig.renewed(Held("leg", key, pem(forged)))) == "certificate_foreign"
        ours = await rig.authorities.issuing()
        unknown = issue_robot(ours, key.public_key(), fleet="fleet", robot="arm", now_ns=now_ns, life_s=DAY)
        assert await code(rig.renewed(Held("arm", key, pem(unknown)))) == "certificate_foreign"


@on_both
async def test_a_copied_disk_is_noticed_at_the_second_renewal(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held, key = await rig.enrolled(), new_key()
        first = await rig.renewed(held, key=key)
        assert (await rig.renewed(held, key=key)).certificate == first.certificate  # its answer was lost
        assert await code(rig.renewed(held)) == "clone_detected"
        (identity,) = await rig.robots.list()
        assert (identity.alarm_ns, bool(identity.alarm)) == (rig.clock.wall_ns(), True)


@on_both
async def test_revoked_is_revoked_until_a_token_for_this_robot(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held = await rig.enrolled()
        await rig.robots.revoke("arm", "stolen")
        assert await code(rig.renewed(held)) == "certificate_revoked"
        assert await code(rig.enrolled()) == "token_foreign"
        again = await rig.enrolled(bound=True)
        assert await code(rig.renewed(held)) == "certificate_revoked"
        assert await code(rig.renewed(again)) == ""


async def test_another_gateway_with_the_master_key_issues_too(tmp_path: Path, postgres: PostgresServer) -> None:
    postgres_url = postgres.schema()
    async with open_identity_rig(tmp_path / "a", postgres_url) as one:
        held = await one.enrolled()
        async with open_identity_rig(tmp_path / "b", postgres_url) as two:
            with pytest.raises(AuthorityError, match=r"master\.key"):
                await two.enrol.make_token(made_by="ada")
            (tmp_path / "b" / "master.key").write_bytes((tmp_path / "a" / "master.key").read_bytes())
            assert await code(two.renewed(held, nonce=await one.enrol.challenge())) == ""
            token, _ = await two.enrol.make_token(made_by="ada")
            assert await code(one.enrol.enrol(token.text, "leg", ask(new_key()))) == ""


async def test_the_issuer_survives_a_restart_and_is_followed_in_time(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held, first = await rig.enrolled(), await rig.authorities.issuing()
        assert (tmp_path / "ca-root.key").stat().st_mode & 0o777 == 0o600
    async with open_identity_rig(tmp_path, store_url) as rig:
        assert (await rig.authorities.issuing()).id == first.id
        await check_followed(rig, held, first.id)


async def check_followed(rig: IdentityRig, held: Held, first: str) -> None:
    """Two years on a new issuer signs, under the same root; the old one's certificates are still known."""
    rig.clock.advance(29 * DAY)
    key = new_key()
    held = Held("arm", key, (await rig.renewed(held, key=key)).certificate)
    rig.clock.advance(2.1 * 365 * DAY)
    second = await rig.authorities.issuing()
    assert second.id != first
    assert len(rig.authorities.issuers) == 2
    assert len(rig.authorities.pins) == 1
    assert await code(rig.enrolled("leg")) == ""
    assert await code(rig.renewed(held)) == "certificate_expired"


async def test_a_supplied_issuer_is_used(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        now_ns = rig.clock.wall_ns()
    made = make_intermediate("fleet", *make_root("fleet", now_ns=now_ns), now_ns=now_ns)
    assert made.key is not None
    (tmp_path / "ca.pem").write_text(pem(made.certificate, made.root))
    (tmp_path / "ca.key").write_bytes(key_pem(made.key))
    options = {"ca_cert": tmp_path / "ca.pem", "ca_key": tmp_path / "ca.key"}
    async with open_identity_rig(tmp_path, store_url, **options) as rig:
        token, _ = await rig.enrol.make_token(made_by="ada")
        assert token.pin == made.pin
        given = await rig.enrol.enrol(token.text, "arm", ask(new_key()))
        assert given.chain == pem(made.certificate)
        assert not (tmp_path / "master.key").exists()
