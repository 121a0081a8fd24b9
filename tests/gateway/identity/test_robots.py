"""Who may open a lane, and stay: proofs, revocations at another gateway, ends of certificates, clones."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.identity import Admitted, Peer
from gateway.errors import UnknownRobotError, UnprovenError
from gateway.identity.certificates.ca import issue_robot, make_intermediate, make_root, pem
from metaros._proto import link_pb2
from tests.gateway.identity.identity_rig import DAY, Held, IdentityRig, open_identity_rig
from tests.gateway.identity.robot_keys import new_key
from tests.support.servers.databases import on_both
from tests.support.servers.postgres import PostgresServer


async def admit(rig: IdentityRig, held: Held, *, key: Any = None, robot: str = "", **reported: Any) -> str:
    """The code of the refusal of a Hello whose challenge is answered; the serial when it is admitted."""
    hello = held.hello(robot=robot)

    async def ask(challenge: link_pb2.Challenge) -> bytes:
        asked = link_pb2.Challenge(
            nonce=reported.get("nonce", challenge.nonce), audience=reported.get("audience", challenge.audience)
        )
        return held.prove(hello, asked, key=key)

    try:
        return (await rig.robots.admit(hello, Peer(), ask)).serial
    except UnprovenError as error:
        return error.code


async def bare(rig: IdentityRig, robot: str) -> str:
    """The same of a Hello that shows nothing."""
    try:
        admitted = await rig.robots.admit(link_pb2.Hello(robot_id=robot), Peer(local=True), never)
    except UnprovenError as error:
        return error.code
    return admitted.serial


async def never(challenge: link_pb2.Challenge) -> bytes:
    raise AssertionError("nobody is asked")


def may_stay(rig: IdentityRig, admitted: Admitted) -> str:
    """Why it may not; "" when it may."""
    try:
        rig.robots.recheck(admitted)
    except UnprovenError as error:
        return error.code
    return ""


async def test_who_holds_the_key_is_admitted(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held = await rig.enrolled()
        assert await admit(rig, held) == held.serial
        assert await admit(rig, held, key=new_key()) == "proof_refused"
        assert await admit(rig, held, nonce=b"o" * 32) == "proof_refused"  # an answer to another challenge
        assert await admit(rig, held, audience="other") == "proof_refused"
        assert await admit(rig, held, robot="leg") == "certificate_foreign"


async def test_over_tls_nobody_is_asked(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held = await rig.enrolled()
        hello = link_pb2.Hello(robot_id="arm")
        admitted = await rig.robots.admit(hello, Peer(held.certificate.encode()), never)
        assert admitted.serial == held.serial
        with pytest.raises(UnprovenError, match="that of arm"):
            await rig.robots.admit(link_pb2.Hello(robot_id="leg"), Peer(held.certificate.encode()), never)


@on_both
async def test_a_name_with_an_identity_is_nobody_elses(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        assert await bare(rig, "arm") == ""
        before = Admitted("arm")
        assert may_stay(rig, before) == ""
        await rig.enrolled()
        assert await bare(rig, "arm") == "not_enrolled"
        assert may_stay(rig, before) == "not_enrolled"
        assert await bare(rig, "leg") == ""
        await rig.robots.revoke("arm", "")
        assert await bare(rig, "arm") == "not_enrolled"


async def test_enrolment_may_be_required_of_all(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url, required=True) as rig:
        held = await rig.enrolled()
        assert await bare(rig, "leg") == "not_enrolled"
        assert await admit(rig, held) == held.serial


async def test_a_strangers_certificate_is_refused_by_name(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held, key, now_ns = await rig.enrolled(), new_key(), rig.clock.wall_ns()
        stranger = make_intermediate("fleet", *make_root("fleet", now_ns=now_ns), now_ns=now_ns)
        forged = issue_robot(stranger, key.public_key(), fleet="fleet", robot="arm", now_ns=now_ns, life_s=DAY)
        assert await admit(rig, Held("arm", key, pem(forged))) == "certificate_foreign"
        unknown = issue_robot(
            await rig.authorities.issuing(), key.public_key(), fleet="fleet", robot="leg", now_ns=now_ns, life_s=DAY
        )
        assert await admit(rig, Held("leg", key, pem(unknown))) == "certificate_foreign"
        hello = held.hello()
        for certificates in ([b"nothing"], [held.der] * 5):
            shown = link_pb2.Hello(robot_id="arm", certificates=certificates, session_id=hello.session_id)
            with pytest.raises(UnprovenError) as refused:
                await rig.robots.admit(shown, Peer(), never)
            assert refused.value.code == "certificate_foreign"


async def test_a_certificate_that_ended_is_refused_and_ends_its_link(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        held = await rig.enrolled()
        admitted = await rig.robots.admit(held.hello(), Peer(held.certificate.encode()), never)
        rig.clock.advance(DAY - 1)
        await rig.robots.refresh()
        assert may_stay(rig, admitted) == ""
        rig.clock.advance(1.1)
        assert may_stay(rig, admitted) == "certificate_expired"
        assert await admit(rig, held) == "certificate_expired"
        key = new_key()
        renewed = Held("arm", key, (await rig.renewed(held, key=key)).certificate)
        assert await admit(rig, renewed) == renewed.serial


async def test_a_revocation_at_one_gateway_is_seen_by_the_other(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    async with open_identity_rig(tmp_path / "a", url) as one, open_identity_rig(tmp_path / "b", url) as two:
        held = await one.enrolled()
        assert await admit(two, held) == held.serial  # enrolled there a moment ago, and by an issuer made there
        admitted = Admitted("arm", held.serial, one.clock.wall_ns() + 10**12)
        assert may_stay(two, admitted) == ""
        await one.robots.revoke("arm", "stolen")
        assert await two.robots.refresh()
        assert may_stay(two, admitted) == "certificate_revoked"
        assert await admit(two, held) == "certificate_revoked"
        again = await one.enrolled(bound=True)
        await two.robots.refresh()
        assert may_stay(two, admitted) == "certificate_revoked"
        assert await admit(two, again) == again.serial


async def test_nobody_is_revoked_who_is_nobody(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        await rig.enrolled()
        with pytest.raises(UnknownRobotError):
            await rig.robots.revoke("leg", "")
        await rig.robots.revoke("arm", "first")
        await rig.robots.revoke("arm", "second")
        (identity,) = await rig.robots.list()
        assert identity.reason == "first"


@on_both
async def test_a_clone_is_remembered(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        rig.robots.cloned("arm")  # has no identity: nothing to copy
        await rig.enrolled()
        rig.robots.cloned("arm")

        async with asyncio.timeout(60):
            while not any(item.alarm for item in await rig.robots.list()):  # noqa: ASYNC110 - the store tells nobody
                await asyncio.sleep(0.01)
