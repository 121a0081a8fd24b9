"""Who may open a lane, and stay: proofs, revocations at another gateway, ends of certificates, clones."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.identity import Admitted, Peer
from gateway.errors import UnknownRobotError, UnprovenError
from gateway.identity.ca import issue_robot, make_intermediate, make_root, pem
from metaros._proto import link_pb2
from tests.gateway.identity.desks import DAY, Desks, Held, open_desks
from tests.gateway.identity.robot_keys import new_key
from tests.support.databases import on_both
from tests.support.postgres import PostgresServer


async def admit(desks: Desks, held: Held, *, key: Any = None, robot: str = "", **told: Any) -> str:
    """The code of the refusal of a Hello whose challenge is answered; the serial when it is admitted."""
    hello = held.hello(robot=robot)

    async def ask(challenge: link_pb2.Challenge) -> bytes:
        asked = link_pb2.Challenge(
            nonce=told.get("nonce", challenge.nonce), audience=told.get("audience", challenge.audience)
        )
        return held.prove(hello, asked, key=key)

    try:
        return (await desks.robots.admit(hello, Peer(), ask)).serial
    except UnprovenError as error:
        return error.code


async def bare(desks: Desks, robot: str) -> str:
    """The same of a Hello that shows nothing."""
    try:
        admitted = await desks.robots.admit(link_pb2.Hello(robot_id=robot), Peer(local=True), never)
    except UnprovenError as error:
        return error.code
    return admitted.serial


async def never(challenge: link_pb2.Challenge) -> bytes:
    raise AssertionError("nobody is asked")


def may_stay(desks: Desks, admitted: Admitted) -> str:
    """Why it may not; "" when it may."""
    try:
        desks.robots.still(admitted)
    except UnprovenError as error:
        return error.code
    return ""


async def test_who_holds_the_key_is_admitted(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        held = await desks.enrolled()
        assert await admit(desks, held) == held.serial
        assert await admit(desks, held, key=new_key()) == "proof_refused"
        assert await admit(desks, held, nonce=b"o" * 32) == "proof_refused"  # an answer to another challenge
        assert await admit(desks, held, audience="other") == "proof_refused"
        assert await admit(desks, held, robot="leg") == "certificate_foreign"


async def test_over_tls_nobody_is_asked(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        held = await desks.enrolled()
        hello = link_pb2.Hello(robot_id="arm")
        admitted = await desks.robots.admit(hello, Peer(held.certificate.encode()), never)
        assert admitted.serial == held.serial
        with pytest.raises(UnprovenError, match="that of arm"):
            await desks.robots.admit(link_pb2.Hello(robot_id="leg"), Peer(held.certificate.encode()), never)


@on_both
async def test_a_name_with_an_identity_is_nobody_elses(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        assert await bare(desks, "arm") == ""
        before = Admitted("arm")
        assert may_stay(desks, before) == ""
        await desks.enrolled()
        assert await bare(desks, "arm") == "not_enrolled"
        assert may_stay(desks, before) == "not_enrolled"
        assert await bare(desks, "leg") == ""
        await desks.robots.revoke("arm", "")
        assert await bare(desks, "arm") == "not_enrolled"


async def test_enrolment_may_be_required_of_all(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url, required=True) as desks:
        held = await desks.enrolled()
        assert await bare(desks, "leg") == "not_enrolled"
        assert await admit(desks, held) == held.serial


async def test_a_strangers_certificate_is_refused_by_name(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        held, key, now_ns = await desks.enrolled(), new_key(), desks.clock.wall_ns()
        stranger = make_intermediate("fleet", *make_root("fleet", now_ns=now_ns), now_ns=now_ns)
        forged = issue_robot(stranger, key.public_key(), fleet="fleet", robot="arm", now_ns=now_ns, life_s=DAY)
        assert await admit(desks, Held("arm", key, pem(forged))) == "certificate_foreign"
        unknown = issue_robot(
            await desks.authorities.issuing(), key.public_key(), fleet="fleet", robot="leg", now_ns=now_ns, life_s=DAY
        )
        assert await admit(desks, Held("leg", key, pem(unknown))) == "certificate_foreign"
        hello = held.hello()
        for certificates in ([b"nothing"], [held.der] * 5):
            shown = link_pb2.Hello(robot_id="arm", certificates=certificates, session_id=hello.session_id)
            with pytest.raises(UnprovenError) as refused:
                await desks.robots.admit(shown, Peer(), never)
            assert refused.value.code == "certificate_foreign"


async def test_a_certificate_that_ended_is_refused_and_ends_its_link(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        held = await desks.enrolled()
        admitted = await desks.robots.admit(held.hello(), Peer(held.certificate.encode()), never)
        desks.clock.advance(DAY - 1)
        await desks.robots.refresh()
        assert may_stay(desks, admitted) == ""
        desks.clock.advance(1.1)
        assert may_stay(desks, admitted) == "certificate_expired"
        assert await admit(desks, held) == "certificate_expired"
        key = new_key()
        renewed = Held("arm", key, (await desks.renewed(held, key=key)).certificate)
        assert await admit(desks, renewed) == renewed.serial


async def test_a_revocation_at_one_gateway_is_seen_by_the_other(tmp_path: Path, postgres: PostgresServer) -> None:
    url = postgres.schema()
    async with open_desks(tmp_path / "a", url) as one, open_desks(tmp_path / "b", url) as two:
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
    async with open_desks(tmp_path, store_url) as desks:
        await desks.enrolled()
        with pytest.raises(UnknownRobotError):
            await desks.robots.revoke("leg", "")
        await desks.robots.revoke("arm", "first")
        await desks.robots.revoke("arm", "second")
        (identity,) = await desks.robots.list()
        assert identity.reason == "first"


@on_both
async def test_a_clone_is_remembered(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        desks.robots.cloned("arm")  # has no identity: nothing to copy
        await desks.enrolled()
        desks.robots.cloned("arm")

        async with asyncio.timeout(60):
            while not any(item.alarm for item in await desks.robots.list()):  # noqa: ASYNC110 - the store tells nobody
                await asyncio.sleep(0.01)
