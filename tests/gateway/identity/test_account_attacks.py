"""What somebody with bad intent tries with an account: rights that outlive their owner, changes that come too late."""

from __future__ import annotations

import asyncio

import pytest

from gateway.domain.principal import EVERY_ROBOT, Principal, Role
from gateway.errors import CredentialsError, ForbiddenError, MetarosError
from gateway.identity.keys import KeyRequest, NewKey
from gateway.identity.oidc.client import Person
from tests.gateway.identity.test_store_authenticator import PASSWORD, Gate, gate
from tests.support.servers.databases import on_both

__all__ = ["gate"]
ADMIN_KEY = KeyRequest("k", Role.ADMIN)


async def key_of(gate: Gate, asker: Principal, wanted: KeyRequest = ADMIN_KEY) -> tuple[NewKey, Principal]:
    """A new key, and whom it means."""
    made = await gate.accounts.create_key(asker, wanted)
    found = await gate.authenticator.by_key(made.text)
    assert found is not None
    return made, found


async def admin(gate: Gate, name: str = "eve") -> Principal:
    """An admin who has signed in."""
    await gate.user(name, Role.ADMIN)
    return await gate.who(await gate.sign_in(name))


async def test_what_a_key_makes_does_not_outlive_its_user(gate: Gate) -> None:
    eve = await admin(gate)
    await gate.user("root", Role.ADMIN)
    _, first = await key_of(gate, eve)
    second, _ = await key_of(gate, first)
    third, _ = await key_of(gate, (await gate.authenticator.by_key(second.text)) or eve)
    assert second.key.user_id == third.key.user_id == eve.id
    await gate.accounts.change_user("eve", role=None, robots=None, disabled=True, password=None)
    assert [await gate.authenticator.by_key(made.text) for made in (second, third)] == [None, None]
    with pytest.raises(CredentialsError):
        await gate.accounts.create_key(first, ADMIN_KEY)


async def test_what_a_key_makes_does_not_outlive_the_key(gate: Gate) -> None:
    eve = await admin(gate)
    made, short = await key_of(gate, eve, KeyRequest("short", Role.ADMIN, expires_s=60.0))
    kept = await gate.accounts.create_key(short, ADMIN_KEY)
    assert kept.key.expires_ns == made.key.expires_ns
    longer = await gate.accounts.create_key(short, ADMIN_KEY._replace(expires_s=3600.0))
    assert longer.key.expires_ns == made.key.expires_ns
    await gate.accounts.revoke_key(eve, made.key.id)
    with pytest.raises(CredentialsError):
        await gate.accounts.create_key(short, ADMIN_KEY)


async def test_a_lesser_admin_s_key_makes_none(gate: Gate) -> None:
    eve = await admin(gate)
    await gate.user("root", Role.ADMIN)
    _, key = await key_of(gate, eve)
    await gate.accounts.change_user("eve", role=Role.OPERATOR, robots=("sim_*",), disabled=None, password=None)
    with pytest.raises(MetarosError):
        await gate.accounts.create_key(key, ADMIN_KEY)


@on_both
async def test_a_password_under_way_does_not_undo_the_admin_s_reset(gate: Gate) -> None:
    """Who holds a stolen session changes the password while an admin resets it: in whatever order, the reset stays."""
    await gate.user()
    thief = await gate.who(await gate.sign_in())
    under_way = asyncio.create_task(
        gate.accounts.change_own_password(thief, PASSWORD, "the thief's own password", address="10.0.0.9")
    )
    await asyncio.sleep(0)  # it has begun: its old password is compared on a thread
    await gate.accounts.change_user("ada", role=None, robots=None, disabled=None, password="what the admin has chosen")
    await asyncio.gather(under_way, return_exceptions=True)
    await gate.sign_in(password="what the admin has chosen")
    with pytest.raises(CredentialsError):
        await gate.sign_in(password="the thief's own password")


async def test_a_namesake_s_password_is_not_one_s_own(gate: Gate) -> None:
    await gate.accounts.create_user("ada", role=Role.VIEWER, robots=EVERY_ROBOT, password="")
    _, link = await gate.accounts.make_link("ada")
    old = await gate.who((await gate.accounts.follow_link(link.token, address="10.0.0.1")).session.token)
    await gate.accounts.delete_user("ada")
    await gate.accounts.create_user("ada", role=Role.OPERATOR, robots=EVERY_ROBOT, password="")
    with pytest.raises(CredentialsError):
        await gate.accounts.change_own_password(old, "", "the thief's own password", address="10.0.0.9")


async def test_who_signs_in_remote_has_no_password_here(gate: Gate) -> None:
    """With one they would come in past the provider, which is where they are locked out."""
    person = Person("https://id.example eve", "eve", Role.OPERATOR)
    done = await gate.accounts.sign_in_person(person, robots=EVERY_ROBOT, address="10.0.0.1")
    eve = await gate.who(done.session.token)
    with pytest.raises(ForbiddenError):
        await gate.accounts.change_own_password(eve, "", PASSWORD, address="10.0.0.1")


@on_both
async def test_of_thirty_who_follow_one_link_one_comes_in(gate: Gate) -> None:
    await gate.user()
    _, link = await gate.accounts.make_link("ada")
    tried = [gate.accounts.follow_link(link.token, address=f"10.0.0.{n}") for n in range(30)]
    done = await asyncio.gather(*tried, return_exceptions=True)
    assert sum(not isinstance(one, BaseException) for one in done) == 1
    assert {type(one) for one in done if isinstance(one, BaseException)} == {CredentialsError}
