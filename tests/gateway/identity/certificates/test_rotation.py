"""Issuers and roots that follow one another, on both databases: nobody is left behind, and what goes is gone."""

from __future__ import annotations

from pathlib import Path

import pytest

from gateway.domain.identity import Admitted, Peer
from gateway.errors import AuthorityError, IdentityError, UnprovenError
from gateway.identity.certificates.ca import pem
from gateway.identity.certificates.parsing import load_certificate, pin
from gateway.identity.certificates.root_key import ROOT_KEY, ROOT_KEY_NEXT, has_root_key
from gateway.identity.certificates.rotation import issuers, retire, retirement, rotate_issuer, rotate_root, settle
from gateway.store.accounts.issuers import set_renew_before
from metaros._proto import link_pb2
from tests.gateway.identity.identity_rig import DAY, Held, IdentityRig, open_identity_rig
from tests.gateway.identity.robot_keys import ask, new_key
from tests.support.servers.databases import on_both


async def rotate(rig: IdentityRig, folder: Path, *, root: bool = False) -> None:
    """What `metaros ca rotate` does, and what the gateway notices of it."""
    make, now_ns = rotate_root if root else rotate_issuer, rig.clock.wall_ns()
    await rig.store.run(lambda engine: make(engine, folder, now_ns=now_ns))
    await rig.store.run(lambda engine: settle(engine, folder))
    assert await rig.authorities.follow()


async def retired(rig: IdentityRig, *, force: bool = False) -> tuple[str, ...]:
    """What `metaros ca retire` does; the robots left behind."""
    now_ns = rig.clock.wall_ns()
    done = await rig.store.run(lambda engine: retire(engine, now_ns=now_ns, force=force))
    await rig.authorities.follow()
    return done.stranded


async def renewed(rig: IdentityRig, held: Held) -> Held:
    """The robot with its next certificate."""
    key = new_key()
    return Held(held.robot, key, (await rig.renewed(held, key=key)).certificate)


async def admitted(rig: IdentityRig, held: Held) -> Admitted:
    """The robot's lane, with the challenge."""

    async def prove(challenge: link_pb2.Challenge) -> bytes:
        return held.prove(hello, challenge)

    hello = held.hello()
    return await rig.robots.admit(hello, Peer(), prove)


async def refusal(rig: IdentityRig, held: Held) -> str:
    """Why it is not admitted."""
    with pytest.raises(UnprovenError) as refused:
        await admitted(rig, held)
    return refused.value.code


async def test_a_new_issuer_issues_and_the_one_before_is_recognised_until_it_is_retired(
    tmp_path: Path, store_url: str
) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        arm, leg = await rig.enrolled("arm"), await rig.enrolled("leg")
        old = rig.authorities.current_id
        await rotate(rig, tmp_path)
        assert rig.authorities.current_id != old
        assert len(rig.authorities.issuers) == 2
        assert rig.authorities.roots_pem.count("BEGIN") == 1
        lane = await admitted(rig, leg)
        arm = await renewed(rig, arm)
        shown = await rig.store.run(lambda engine: issuers(engine, now_ns=rig.clock.wall_ns()))
        assert [(one.state, one.robots) for one in shown] == [("issues", 1), ("accepted", 1)]
        with pytest.raises(AuthorityError, match="leg"):
            await retired(rig)
        assert await retired(rig, force=True) == ("leg",)
        assert (await admitted(rig, arm)).robot == "arm"
        assert await refusal(rig, leg) == "certificate_foreign"
        with pytest.raises(UnprovenError) as cut:
            rig.robots.recheck(lane)
        assert (cut.value.code, cut.value.retry_after_ms) == ("certificate_expired", 200)
        with pytest.raises(IdentityError) as refused:
            await rig.renewed(leg)
        assert refused.value.code == "certificate_foreign"


async def test_a_new_root_is_reached_over_the_old_one_until_that_is_retired(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        arm = await rig.enrolled("arm")
        before = load_certificate(rig.authorities.roots_pem)
        await rotate(rig, tmp_path, root=True)
        key = new_key()
        given = await rig.renewed(arm, key=key)
        leaf, over = load_certificate(given.certificate), load_certificate(given.chain)
        leaf.verify_directly_issued_by(over)
        over.verify_directly_issued_by(before)  # who knows the old root alone believes it
        assert given.roots.count("BEGIN") == 2
        assert given.vouchers.count("BEGIN") == 1
        token, _ = await rig.enrol.make_token(made_by="ada")
        assert token.pin == pin(before)  # whose pin still is the one that the gateway's TLS leads to
        arm = Held("arm", key, given.certificate)
        lane = await admitted(rig, arm)
        assert await retired(rig) == ()
        rig.robots.recheck(lane)  # the same issuer, under its own root: no link is cut
        assert (await admitted(rig, arm)).robot == "arm"
        again = await rig.renewed(arm)
        (root,) = [load_certificate(again.roots)]
        assert pin(root) != pin(before)
        load_certificate(again.chain).verify_directly_issued_by(root)
        load_certificate(again.certificate).verify_directly_issued_by(load_certificate(again.chain))
        assert has_root_key(tmp_path, root)
        with pytest.raises(IdentityError) as refused:
            await rig.enrol.enrol(token.text, "leg", ask(new_key()))
        assert refused.value.code == "token_foreign"
        await rotate(rig, tmp_path)  # and the new root's key makes issuers


@on_both
async def test_a_robot_that_was_off_renews_in_its_grace_and_one_beyond_it_holds_nothing_up(
    tmp_path: Path, store_url: str
) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        arm, _ = await rig.enrolled("arm"), await rig.enrolled("leg")
        await rotate(rig, tmp_path, root=True)
        rig.clock.advance(DAY * 20)  # certificates are of one day
        plan = await rig.store.run(lambda engine: retirement(engine, now_ns=rig.clock.wall_ns()))
        assert plan.stranded == ("arm", "leg")
        arm = await renewed(rig, arm)
        rig.clock.advance(DAY * 12)
        assert await retired(rig) == ()  # leg's grace is over: it needs a token anyway
        assert (await renewed(rig, arm)).robot == "arm"


async def test_the_answer_that_was_lost_comes_with_the_chain_of_whoever_had_given_it(
    tmp_path: Path, store_url: str
) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        arm, key = await rig.enrolled("arm"), new_key()
        first = await rig.renewed(arm, key=key)
        await rotate(rig, tmp_path)
        again = await rig.renewed(arm, key=key)
        assert (again.certificate, again.fresh) == (first.certificate, False)
        load_certificate(again.certificate).verify_directly_issued_by(load_certificate(again.chain))


async def test_a_renewal_that_began_before_another_issuer_followed_ends_well(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        arm = await rig.enrolled("arm")
        asked = await rig.enrol.challenge()
        await rotate(rig, tmp_path)
        given = await rig.renewed(arm, nonce=asked)
        assert load_certificate(given.chain) == rig.authorities.issuers[0]
        late = await rig.enrol.challenge()
        await rotate(rig, tmp_path)
        await retired(rig, force=True)
        with pytest.raises(IdentityError) as refused:
            await rig.renewed(arm, nonce=late)
        assert refused.value.code == "proof_refused"


@on_both
async def test_all_robots_renew_when_they_are_asked_to(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        arm = await rig.enrolled("arm")
        lane = await admitted(rig, arm)
        rig.clock.advance(10)
        now_ns = rig.clock.wall_ns()
        await rig.store.run(lambda engine: set_renew_before(engine, now_ns // 10**9 * 10**9))
        await rig.authorities.follow()
        with pytest.raises(UnprovenError, match="renewed now"):
            rig.robots.recheck(lane)
        assert await refusal(rig, arm) == "certificate_expired"
        arm = await renewed(rig, arm)
        assert (await admitted(rig, arm)).robot == "arm"
        ahead_ns = now_ns + 3600 * 10**9  # said on a machine whose clock is an hour ahead
        await rig.store.run(lambda engine: set_renew_before(engine, ahead_ns))
        await rig.authorities.follow()
        assert (await admitted(rig, arm)).robot == "arm"
        rig.clock.advance(3601)
        assert await refusal(rig, arm) == "certificate_expired"
        assert (await admitted(rig, await renewed(rig, arm))).robot == "arm"


async def test_a_root_in_change_is_changed_no_further(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        with pytest.raises(AuthorityError, match="no authority yet"):
            await rotate(rig, tmp_path)
        await rig.authorities.issuing()
        await rotate(rig, tmp_path, root=True)
        for root in (True, False):
            with pytest.raises(AuthorityError, match="metaros ca retire"):
                await rotate(rig, tmp_path, root=root)
        await retired(rig)
        (tmp_path / ROOT_KEY).rename(tmp_path / "elsewhere")
        with pytest.raises(AuthorityError, match="root's key"):
            await rotate(rig, tmp_path)


async def test_of_a_change_that_was_broken_off_the_new_key_is_found(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        await rig.authorities.issuing()
        old = load_certificate(rig.authorities.roots_pem)
        now_ns = rig.clock.wall_ns()

        def killed(engine: object) -> None:
            rotate_root(engine, tmp_path, now_ns=now_ns)  # type: ignore[arg-type]
            raise AuthorityError("killed before the commit")

        with pytest.raises(AuthorityError, match="killed"):
            await rig.store.run(killed)
        assert (tmp_path / ROOT_KEY_NEXT).exists()
        assert has_root_key(tmp_path, old)
        await rig.store.run(lambda engine: rotate_root(engine, tmp_path, now_ns=now_ns))  # and killed after it
        await rig.authorities.follow()
        new = next(
            load_certificate(part + "-----END CERTIFICATE-----\n")
            for part in rig.authorities.roots_pem.split("-----END CERTIFICATE-----\n")
            if part and load_certificate(part + "-----END CERTIFICATE-----\n") != old
        )
        assert has_root_key(tmp_path, new)
        await retired(rig)
        await rotate(rig, tmp_path)
        assert not (tmp_path / ROOT_KEY_NEXT).exists()
        assert has_root_key(tmp_path, new)
        assert rig.authorities.roots_pem == pem(new)


async def test_a_supplied_issuer_has_its_successor_remote(tmp_path: Path, store_url: str) -> None:
    async with open_identity_rig(tmp_path, store_url) as rig:
        await rig.authorities.issuing()

        def forgotten(engine: object) -> None:
            engine.execute("UPDATE authorities SET sealed_key = ?", b"")  # type: ignore[attr-defined]

        await rig.store.run(forgotten)
        with pytest.raises(AuthorityError, match="supplied"):
            await rotate(rig, tmp_path)
