"""Issuers and roots that follow one another, on both databases: nobody is left behind, and what goes is gone."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.domain.identity import Admitted, Peer
from gateway.errors import AuthorityError, IdentityError, UnprovenError
from gateway.identity.ca import pem
from gateway.identity.certificates import load_certificate, pin
from gateway.identity.root_key import ROOT_KEY, ROOT_KEY_NEXT, has_root_key
from gateway.identity.rotation import issuers, retire, retirement, rotate_issuer, rotate_root, settle
from gateway.store.issuers import set_renew_before
from metaros._proto import link_pb2
from tests.gateway.identity.desks import DAY, Desks, Held, open_desks
from tests.gateway.identity.robot_keys import ask, new_key
from tests.support.databases import on_both


async def rotate(desks: Desks, folder: Path, *, root: bool = False) -> None:
    """What `metaros ca rotate` does, and what the gateway notices of it."""
    make, now_ns = rotate_root if root else rotate_issuer, desks.clock.wall_ns()
    await desks.store.run(lambda engine: make(engine, folder, now_ns=now_ns))
    await desks.store.run(lambda engine: settle(engine, folder))
    assert await desks.authorities.follow()


async def retired(desks: Desks, *, force: bool = False) -> tuple[str, ...]:
    """What `metaros ca retire` does; the robots left behind."""
    now_ns = desks.clock.wall_ns()
    done = await desks.store.run(lambda engine: retire(engine, now_ns=now_ns, force=force))
    await desks.authorities.follow()
    return done.stranded


async def renewed(desks: Desks, held: Held) -> Held:
    """The robot with its next certificate."""
    key = new_key()
    return Held(held.robot, key, (await desks.renewed(held, key=key)).certificate)


async def admitted(desks: Desks, held: Held) -> Admitted:
    """The robot's lane, with the challenge."""

    async def prove(challenge: link_pb2.Challenge) -> bytes:
        return held.prove(hello, challenge)

    hello = held.hello()
    return await desks.robots.admit(hello, Peer(), prove)


async def refusal(desks: Desks, held: Held) -> str:
    """Why it is not admitted."""
    with pytest.raises(UnprovenError) as refused:
        await admitted(desks, held)
    return refused.value.code


async def test_a_new_issuer_issues_and_the_one_before_is_recognised_until_it_is_retired(
    tmp_path: Path, store_url: str
) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        arm, leg = await desks.enrolled("arm"), await desks.enrolled("leg")
        old = desks.authorities.current_id
        await rotate(desks, tmp_path)
        assert desks.authorities.current_id != old
        assert len(desks.authorities.issuers) == 2
        assert desks.authorities.roots_pem.count("BEGIN") == 1
        lane = await admitted(desks, leg)
        arm = await renewed(desks, arm)
        shown = await desks.store.run(lambda engine: issuers(engine, now_ns=desks.clock.wall_ns()))
        assert [(one.state, one.robots) for one in shown] == [("issues", 1), ("accepted", 1)]
        with pytest.raises(AuthorityError, match="leg"):
            await retired(desks)
        assert await retired(desks, force=True) == ("leg",)
        assert (await admitted(desks, arm)).robot == "arm"
        assert await refusal(desks, leg) == "certificate_foreign"
        with pytest.raises(UnprovenError) as cut:
            desks.robots.still(lane)
        assert (cut.value.code, cut.value.retry_after_ms) == ("certificate_expired", 200)
        with pytest.raises(IdentityError) as refused:
            await desks.renewed(leg)
        assert refused.value.code == "certificate_foreign"


async def test_a_new_root_is_reached_over_the_old_one_until_that_is_retired(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        arm = await desks.enrolled("arm")
        before = load_certificate(desks.authorities.roots_pem)
        await rotate(desks, tmp_path, root=True)
        key = new_key()
        given = await desks.renewed(arm, key=key)
        leaf, over = load_certificate(given.certificate), load_certificate(given.chain)
        leaf.verify_directly_issued_by(over)
        over.verify_directly_issued_by(before)  # who knows the old root alone believes it
        assert given.roots.count("BEGIN") == 2
        assert given.vouchers.count("BEGIN") == 1
        token, _ = await desks.enrol.make_token(made_by="ada")
        assert token.pin == pin(before)  # whose pin still is the one that the gateway's TLS leads to
        arm = Held("arm", key, given.certificate)
        lane = await admitted(desks, arm)
        assert await retired(desks) == ()
        desks.robots.still(lane)  # the same issuer, under its own root: no link is cut
        assert (await admitted(desks, arm)).robot == "arm"
        again = await desks.renewed(arm)
        (root,) = [load_certificate(again.roots)]
        assert pin(root) != pin(before)
        load_certificate(again.chain).verify_directly_issued_by(root)
        load_certificate(again.certificate).verify_directly_issued_by(load_certificate(again.chain))
        assert has_root_key(tmp_path, root)
        with pytest.raises(IdentityError) as refused:
            await desks.enrol.enrol(token.text, "leg", ask(new_key()))
        assert refused.value.code == "token_foreign"
        await rotate(desks, tmp_path)  # and the new root's key makes issuers


@on_both
async def test_a_robot_that_was_off_renews_in_its_grace_and_one_beyond_it_holds_nothing_up(
    tmp_path: Path, store_url: str
) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        arm, _ = await desks.enrolled("arm"), await desks.enrolled("leg")
        await rotate(desks, tmp_path, root=True)
        desks.clock.advance(DAY * 20)  # certificates are of one day
        plan = await desks.store.run(lambda engine: retirement(engine, now_ns=desks.clock.wall_ns()))
        assert plan.stranded == ("arm", "leg")
        arm = await renewed(desks, arm)
        desks.clock.advance(DAY * 12)
        assert await retired(desks) == ()  # leg's grace is over: it needs a token anyway
        assert (await renewed(desks, arm)).robot == "arm"


async def test_the_answer_that_was_lost_comes_with_the_chain_of_whoever_had_given_it(
    tmp_path: Path, store_url: str
) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        arm, key = await desks.enrolled("arm"), new_key()
        first = await desks.renewed(arm, key=key)
        await rotate(desks, tmp_path)
        again = await desks.renewed(arm, key=key)
        assert (again.certificate, again.fresh) == (first.certificate, False)
        load_certificate(again.certificate).verify_directly_issued_by(load_certificate(again.chain))


async def test_a_renewal_that_began_before_another_issuer_followed_ends_well(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        arm = await desks.enrolled("arm")
        asked = await desks.enrol.challenge()
        await rotate(desks, tmp_path)
        given = await desks.renewed(arm, nonce=asked)
        assert load_certificate(given.chain) == desks.authorities.issuers[0]
        late = await desks.enrol.challenge()
        await rotate(desks, tmp_path)
        await retired(desks, force=True)
        with pytest.raises(IdentityError) as refused:
            await desks.renewed(arm, nonce=late)
        assert refused.value.code == "proof_refused"


@on_both
async def test_all_robots_renew_when_they_are_asked_to(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        arm = await desks.enrolled("arm")
        lane = await admitted(desks, arm)
        desks.clock.advance(10)
        now_ns = desks.clock.wall_ns()
        await desks.store.run(lambda engine: set_renew_before(engine, now_ns // 10**9 * 10**9))
        await desks.authorities.follow()
        with pytest.raises(UnprovenError, match="renewed now"):
            desks.robots.still(lane)
        assert await refusal(desks, arm) == "certificate_expired"
        arm = await renewed(desks, arm)
        assert (await admitted(desks, arm)).robot == "arm"
        ahead_ns = now_ns + 3600 * 10**9  # said on a machine whose clock is an hour ahead
        await desks.store.run(lambda engine: set_renew_before(engine, ahead_ns))
        await desks.authorities.follow()
        assert (await admitted(desks, arm)).robot == "arm"
        desks.clock.advance(3601)
        assert await refusal(desks, arm) == "certificate_expired"
        assert (await admitted(desks, await renewed(desks, arm))).robot == "arm"


async def test_a_root_in_change_is_changed_no_further(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        with pytest.raises(AuthorityError, match="no authority yet"):
            await rotate(desks, tmp_path)
        await desks.authorities.issuing()
        await rotate(desks, tmp_path, root=True)
        for root in (True, False):
            with pytest.raises(AuthorityError, match="metaros ca retire"):
                await rotate(desks, tmp_path, root=root)
        await retired(desks)
        (tmp_path / ROOT_KEY).rename(tmp_path / "elsewhere")
        with pytest.raises(AuthorityError, match="root's key"):
            await rotate(desks, tmp_path)


async def test_of_a_change_that_was_broken_off_the_new_key_is_found(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        await desks.authorities.issuing()
        old = load_certificate(desks.authorities.roots_pem)
        now_ns = desks.clock.wall_ns()

        def killed(engine: object) -> None:
            rotate_root(engine, tmp_path, now_ns=now_ns)  # type: ignore[arg-type]
            raise AuthorityError("killed before the commit")

        with pytest.raises(AuthorityError, match="killed"):
            await desks.store.run(killed)
        assert (tmp_path / ROOT_KEY_NEXT).exists()
        assert has_root_key(tmp_path, old)
        await desks.store.run(lambda engine: rotate_root(engine, tmp_path, now_ns=now_ns))  # and killed after it
        await desks.authorities.follow()
        new = next(
            load_certificate(part + "-----END CERTIFICATE-----\n")
            for part in desks.authorities.roots_pem.split("-----END CERTIFICATE-----\n")
            if part and load_certificate(part + "-----END CERTIFICATE-----\n") != old
        )
        assert has_root_key(tmp_path, new)
        await retired(desks)
        await rotate(desks, tmp_path)
        assert not (tmp_path / ROOT_KEY_NEXT).exists()
        assert has_root_key(tmp_path, new)
        assert desks.authorities.roots_pem == pem(new)


async def test_a_supplied_issuer_has_its_successor_elsewhere(tmp_path: Path, store_url: str) -> None:
    async with open_desks(tmp_path, store_url) as desks:
        await desks.authorities.issuing()

        def forgotten(engine: object) -> None:
            engine.execute("UPDATE authorities SET sealed_key = ?", b"")  # type: ignore[attr-defined]

        await desks.store.run(forgotten)
        with pytest.raises(AuthorityError, match="supplied"):
            await rotate(desks, tmp_path)
