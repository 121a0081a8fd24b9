"""The door and the accounts behind it, on a real store: who is let in, for how long, and who waits."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from argon2 import PasswordHasher

from gateway.domain.principal import EVERY_ROBOT, Principal, Role, anonymous_viewer
from gateway.errors import CredentialsError, ForbiddenError, InvalidRequestError, SignInError, TooManyRequestsError
from gateway.identity.accounts import Accounts
from gateway.identity.errors import UnknownKeyError
from gateway.identity.keys import KeyRequest
from gateway.identity.master import MasterKey
from gateway.identity.passwords import Passwords
from gateway.identity.store_authenticator import AHEAD_S, REMEMBERED_S, StoreAuthenticator
from gateway.store import Store
from gateway.store.accounts.sessions import end_session
from gateway.store.retention import Retention
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.support.servers.databases import on_both

PASSWORD = "correct horse battery"
LOCAL = Principal(kind="key", id="local", name="local", role=Role.ADMIN, robots=EVERY_ROBOT)
FAST = PasswordHasher(time_cost=1, memory_cost=64, parallelism=1)


class Gate:
    """A store with its door and accounts."""

    def __init__(self, folder: Path, url: str, clock: ManualClock) -> None:
        self.clock = clock
        self.store = Store(
            folder, clock=clock, retention=Retention(age_s=1e6, size_bytes=1 << 30), queue_bytes=1 << 20, url=url
        )
        self.authenticator = StoreAuthenticator(self.store, clock=clock)
        self.accounts = Accounts(
            self.store,
            self.authenticator,
            MasterKey.load_or_make(folder),
            clock=clock,
            passwords=Passwords(hasher=FAST),
        )

    async def user(self, name: str = "ada", role: Role = Role.OPERATOR) -> None:
        await self.accounts.create_user(name, role=role, robots=EVERY_ROBOT, password=PASSWORD)

    async def sign_in(self, name: str = "ada", password: str = PASSWORD, address: str = "10.0.0.1") -> str:
        return (await self.accounts.sign_in(name, password, address=address)).session.token

    async def who(self, token: str) -> Principal:
        found = await self.authenticator.by_session(token)
        assert found is not None
        return found


@pytest.fixture
async def gate(tmp_path: Path, store_url: str, clock: ManualClock) -> AsyncIterator[Gate]:
    made = Gate(tmp_path, store_url, clock)
    made.store.start()
    yield made
    made.accounts.close()
    await made.store.close()


async def test_a_session_is_its_user_until_it_signs_out(gate: Gate) -> None:
    await gate.user()
    token = await gate.sign_in()
    found = await gate.who(token)
    assert (found.kind, found.name, found.role, found.robots) == ("user", "ada", Role.OPERATOR, EVERY_ROBOT)
    assert len(found.csrf) == 64
    assert token not in (found.csrf, found.session_id)
    await gate.accounts.sign_out(found)
    assert await gate.authenticator.by_session(token) is None
    for wrong in ("", token[:-1], found.session_id, found.csrf, "\ud800", "x" * 10_000):
        assert await gate.authenticator.by_session(wrong) is None


async def test_wrong_name_wrong_password_and_disabled_are_reported_alike(gate: Gate) -> None:
    await gate.user()
    await gate.user("bob")
    await gate.accounts.change_user("bob", role=None, robots=None, disabled=True, password=None)
    said = set()
    for name, password in (("ada", "wrong"), ("eve", PASSWORD), ("bob", PASSWORD), ("\x00", "x"), ("\ud800", "\ud800")):
        with pytest.raises(CredentialsError) as refused:
            await gate.sign_in(name, password)
        said.add(str(refused.value))
    assert said == {"the name or the password is wrong"}


async def test_a_guesser_waits_and_nobody_else_does(gate: Gate) -> None:
    await gate.user()
    for _ in range(5):
        with pytest.raises(CredentialsError):
            await gate.sign_in(password="wrong")
    with pytest.raises(TooManyRequestsError):
        await gate.sign_in()  # not even the right one, or one could tell it
    await gate.sign_in(address="10.0.0.2")
    gate.clock.advance(1.0)
    await gate.sign_in()
    for _ in range(4):
        with pytest.raises(CredentialsError):  # all is forgotten
            await gate.sign_in(password="wrong")


@on_both
async def test_thirty_guesses_at_once_are_no_more_than_five(gate: Gate) -> None:
    await gate.user()
    gate.accounts.passwords = Passwords(hasher=FAST, waiting=1000)
    guesses = [gate.sign_in(password=f"wrong {n}") for n in range(30)]
    ends = await asyncio.gather(*guesses, return_exceptions=True)
    assert sum(isinstance(end, CredentialsError) for end in ends) == 5
    assert sum(isinstance(end, TooManyRequestsError) for end in ends) == 25


async def test_names_that_are_nobody_s_lock_out_alike(gate: Gate) -> None:
    for _ in range(5):
        with pytest.raises(CredentialsError):
            await gate.sign_in("nobody", "wrong")
    with pytest.raises(TooManyRequestsError):
        await gate.sign_in("nobody", "wrong")


async def test_a_flood_of_wrong_names_fills_no_disk(gate: Gate) -> None:
    for number in range(10):
        with pytest.raises(CredentialsError):
            await gate.sign_in(f"nobody{number}", "wrong")
    gate.clock.advance(3600.0)
    with pytest.raises(CredentialsError):
        await gate.sign_in("somebody", "wrong")
    rows = await gate.store.run(lambda engine: engine.fetch("SELECT count(*) FROM login_failures"))
    assert rows[0][0] == 1


@on_both
async def test_a_session_ends_unused_or_old(gate: Gate) -> None:
    await gate.user()
    idle, busy = await gate.sign_in(), await gate.sign_in()
    step_s = LIMITS.session_idle_s / 2
    for _ in range(int(LIMITS.session_s / step_s) - 1):
        gate.clock.advance(step_s)
        assert await gate.authenticator.by_session(busy) is not None
    assert await gate.authenticator.by_session(idle) is None
    gate.clock.advance(step_s)
    assert await gate.authenticator.by_session(busy) is None


@on_both
async def test_a_link_signs_in_once(gate: Gate) -> None:
    user, link = await gate.accounts.make_link()
    assert (user.name, user.role) == ("admin", Role.ADMIN)
    tries = [gate.accounts.follow_link(link.token, address="") for _ in range(8)]
    ends = await asyncio.gather(*tries, return_exceptions=True)
    good = [end for end in ends if not isinstance(end, BaseException)]
    assert len(good) == 1
    assert all(isinstance(end, CredentialsError) for end in ends if end is not good[0])
    assert (await gate.who(good[0].session.token)).name == "admin"
    _, late = await gate.accounts.make_link("admin")
    gate.clock.advance(LIMITS.sign_in_link_s)
    with pytest.raises(CredentialsError):
        await gate.accounts.follow_link(late.token, address="")


async def test_one_sets_one_s_own_password(gate: Gate) -> None:
    user, link = await gate.accounts.make_link()
    mine = (await gate.accounts.follow_link(link.token, address="a")).session.token
    me = await gate.who(mine)
    await gate.accounts.change_own_password(me, "", PASSWORD, address="a")  # there was none
    other = await gate.sign_in("admin")
    with pytest.raises(CredentialsError):
        await gate.accounts.change_own_password(me, "wrong", "another horse battery", address="a")
    with pytest.raises(InvalidRequestError):
        await gate.accounts.change_own_password(me, PASSWORD, "short", address="a")
    with pytest.raises(ForbiddenError):
        await gate.accounts.change_own_password(LOCAL, "", PASSWORD, address="a")
    await gate.accounts.change_own_password(me, PASSWORD, "another horse battery", address="a")
    assert await gate.authenticator.by_session(mine) is not None
    assert await gate.authenticator.by_session(other) is None
    await gate.sign_in("admin", "another horse battery")
    assert user.name == me.name


async def test_a_key_opens_until_it_is_revoked_or_expires(gate: Gate) -> None:
    wanted = KeyRequest("ci", Role.OPERATOR, ("sim_*",), frozenset({"lambda"}), 60.0)
    one, two = [await gate.accounts.create_key(LOCAL, wanted) for _ in range(2)]
    found = await gate.authenticator.by_key(one.text)
    assert found is not None
    assert (found.kind, found.id, found.name, found.scopes) == ("key", one.key.id, "ci", {"lambda"})
    assert (found.sees("sim_1"), found.sees("arm")) == (True, False)
    forged = f"mrk_{one.key.id}_{two.secret}"
    for wrong in (forged, one.text[:-1], one.text + "a", one.secret, "", "mrk_x_y", "\ud800", "x" * 10_000):
        assert await gate.authenticator.by_key(wrong) is None
    await gate.accounts.revoke_key(LOCAL, one.key.id)
    assert await gate.authenticator.by_key(one.text) is None
    assert await gate.authenticator.by_key(two.text) is not None
    gate.clock.advance(60.0)
    assert await gate.authenticator.by_key(two.text) is None


async def test_what_changes_remote_counts_within_two_seconds(gate: Gate) -> None:
    await gate.user()
    token = await gate.sign_in()
    found = await gate.who(token)
    await gate.store.run(lambda engine: end_session(engine, found.session_id))  # as another gateway would
    assert await gate.authenticator.by_session(token) == found
    gate.clock.advance(REMEMBERED_S)
    assert await gate.authenticator.by_session(token) is None


@on_both
async def test_who_asks_all_the_time_is_looked_up_behind_the_answer(gate: Gate) -> None:
    await gate.user()
    token = await gate.sign_in()
    found = await gate.who(token)
    looked_up, read = 0, gate.store.read

    async def counted(job: Any) -> Any:
        nonlocal looked_up
        looked_up += 1
        return await read(job)

    gate.store.read = counted  # type: ignore[method-assign]
    for _ in range(4):
        gate.clock.advance(REMEMBERED_S - AHEAD_S)
        assert [await gate.authenticator.by_session(token) for _ in range(3)] == [found] * 3
        assert list(gate.authenticator._ahead) != []
        await asyncio.gather(*gate.authenticator._ahead.values())
    assert looked_up == 4  # and nobody waited
    await gate.store.run(lambda engine: end_session(engine, found.session_id))
    gate.clock.advance(REMEMBERED_S - AHEAD_S)
    assert await gate.authenticator.by_session(token) == found
    await asyncio.gather(*gate.authenticator._ahead.values())
    assert await gate.authenticator.by_session(token) is None


async def test_what_was_found_before_rights_changed_is_not_remembered(gate: Gate) -> None:
    await gate.user()
    token = await gate.sign_in()
    gate.authenticator.forget()
    read = gate.store.read

    async def slow(job: Any) -> Any:
        found = await read(job)
        gate.authenticator.forget()
        return found

    gate.store.read = slow  # type: ignore[method-assign]
    assert await gate.authenticator.by_session(token) is not None
    assert gate.authenticator._known == {}


async def test_a_lesser_role_counts_at_once(gate: Gate) -> None:
    await gate.user("root", Role.ADMIN)
    await gate.user()
    token = await gate.sign_in()
    assert (await gate.who(token)).role is Role.OPERATOR
    await gate.accounts.change_user("ada", role=Role.VIEWER, robots=("sim_1",), disabled=None, password=None)
    assert ((await gate.who(token)).role, (await gate.who(token)).robots) == (Role.VIEWER, ("sim_1",))
    await gate.accounts.delete_user("ada")
    assert await gate.authenticator.by_session(token) is None


async def test_whose_keys_one_makes_sees_and_revokes(gate: Gate) -> None:
    for name in ("ada", "bob"):
        await gate.user(name)
    ada, bob = [await gate.who(await gate.sign_in(name)) for name in ("ada", "bob")]
    key = await gate.accounts.create_key(ada, KeyRequest("ci", Role.OPERATOR))
    assert [(item.name, owner) for item, owner in await gate.accounts.list_keys(ada)] == [("ci", "ada")]
    assert await gate.accounts.list_keys(bob) == []
    assert [owner for _, owner in await gate.accounts.list_keys(LOCAL)] == ["ada"]
    with pytest.raises(ForbiddenError):
        await gate.accounts.create_key(ada, KeyRequest("root", Role.ADMIN))
    by_key = await gate.authenticator.by_key(key.text)
    assert by_key is not None
    with pytest.raises(ForbiddenError):
        await gate.accounts.create_key(by_key, KeyRequest("more", Role.VIEWER))
    with pytest.raises(SignInError):
        await gate.accounts.create_key(anonymous_viewer(), KeyRequest("x", Role.VIEWER))
    with pytest.raises(UnknownKeyError):
        await gate.accounts.revoke_key(anonymous_viewer(), key.key.id)
    await gate.accounts.revoke_key(ada, key.key.id)
    assert await gate.accounts.list_keys(LOCAL) == []


async def test_what_is_remembered_is_bounded_and_holds_no_credential(gate: Gate) -> None:
    key = await gate.accounts.create_key(LOCAL, KeyRequest("ci", Role.VIEWER))
    assert await gate.authenticator.by_key(key.text) is not None
    assert key.secret not in repr(vars(gate.authenticator))
    for _ in range(100):
        assert await gate.authenticator.by_key(key.text[:-1]) is None
    assert len(gate.authenticator._known) == 1


async def test_a_password_with_weak_parameters_is_hashed_again(gate: Gate) -> None:
    await gate.user()
    weak = (await gate.accounts.list_users())[0].password
    gate.accounts.passwords = Passwords(hasher=PasswordHasher(time_cost=2, memory_cost=128, parallelism=1))
    await gate.sign_in()
    assert (await gate.accounts.list_users())[0].password != weak
    await gate.sign_in()
