"""Users', sessions' and keys' rows on both databases."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from gateway.domain.account import ApiKey, Session, User
from gateway.domain.principal import Role
from gateway.store.accounts import api_keys, sessions, users
from gateway.store.accounts.sessions import Failures
from gateway.store.engine import StoreEngine

NOW_NS = 1_700_000_000 * 10**9


def user(name: str = "ada", role: Role = Role.OPERATOR) -> User:
    return User(id=f"id-{name}", name=name, role=role, robots=("sim_*", "ü"), created_ns=NOW_NS)


def session(number: int, user_id: str = "id-ada") -> Session:
    return Session(
        id=f"s{number}",
        user_id=user_id,
        created_ns=NOW_NS + number,
        seen_ns=NOW_NS + number,
        expires_ns=NOW_NS + 100,
        address="127.0.0.1",
    )


def key(key_id: str, user_id: str | None = "id-ada") -> ApiKey:
    return ApiKey(
        id=key_id,
        name="ci",
        user_id=user_id,
        role=Role.VIEWER,
        robots=("sim_1",),
        scopes=frozenset({"lambda"}),
        secret_hash="h",
        sealed=b"\x00sealed\xff",
        created_ns=NOW_NS,
    )


def test_a_user_comes_back_as_it_went_in(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        assert users.add_user(engine, user())
        assert not users.add_user(engine, replace(user(), id="other"))
        assert users.add_user(engine, replace(user("bob"), external="https://idp 42"))
    with engine.transaction(write=True):
        assert users.find_user(engine, "ada") == user()
        assert users.get_user(engine, "id-bob") == users.find_external(engine, "https://idp 42")
        assert users.find_user(engine, "Ada") is None
        assert [item.name for item in users.list_users(engine, limit=10)] == ["ada", "bob"]


def test_changes(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        users.add_user(engine, user())
        assert users.change_user(engine, "id-ada", role=Role.ADMIN, robots=("*",), disabled=True, password="p")
        assert not users.change_user(engine, "nobody", disabled=True)
        with pytest.raises(ValueError, match="columns"):
            users.change_user(engine, "id-ada", name="eve")
        found = users.get_user(engine, "id-ada")
    assert found == replace(user(), role=Role.ADMIN, robots=("*",), disabled=True, password="p")
    assert "p" not in repr(found).split("password")


def test_only_admins_who_may_sign_in_count(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        assert not users.has_admin(engine)
        users.add_user(engine, user("eve", Role.ADMIN))
        users.change_user(engine, "id-eve", disabled=True)
        assert (users.has_admin(engine), users.count_admins(engine)) == (False, 0)
        users.add_user(engine, user("ada", Role.ADMIN))
        assert (users.has_admin(engine), users.count_admins(engine)) == (True, 1)


def test_a_user_goes_with_all_that_is_theirs(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        for name in ("ada", "bob"):
            users.add_user(engine, user(name))
            sessions.add_session(engine, replace(session(1, f"id-{name}"), id=f"s-{name}"), keep=8)
            sessions.add_link(engine, f"l-{name}", f"id-{name}", expires_ns=NOW_NS + 9)
            api_keys.add_key(engine, key(f"k-{name}", f"id-{name}"))
        users.remove_user(engine, "id-ada")
        assert users.get_user(engine, "id-ada") is None
        assert sessions.find_session(engine, "s-ada") is None
        assert sessions.take_link(engine, "l-ada", now_ns=NOW_NS) is None
        assert [item.id for item in api_keys.list_keys(engine, limit=9)] == ["k-bob"]
        assert sessions.find_session(engine, "s-bob") is not None


def test_sessions_are_few_and_end(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        users.add_user(engine, user())
        for number in range(6):
            sessions.add_session(engine, session(number), keep=4)
        left = [number for number in range(6) if sessions.find_session(engine, f"s{number}")]
        assert left == [2, 3, 4, 5]
        assert sessions.end_session(engine, "s2")
        assert not sessions.end_session(engine, "s2")
        sessions.touch_session(engine, "s3", now_ns=NOW_NS + 50)
        found = sessions.find_session(engine, "s3")
        assert found == (replace(session(3), seen_ns=NOW_NS + 50), user())
        assert sessions.end_sessions(engine, "id-ada", but="s5") == 2
        assert sessions.find_session(engine, "s5") is not None


def test_a_link_works_once_of_many_who_try(connect: Callable[[], StoreEngine]) -> None:
    engines = [connect() for _ in range(6)]
    with engines[0].transaction(write=True):
        users.add_user(engines[0], user())
        sessions.add_link(engines[0], "l", "id-ada", expires_ns=NOW_NS + 10)

    def take(engine: StoreEngine) -> bool:
        with engine.transaction(write=True):
            return sessions.take_link(engine, "l", now_ns=NOW_NS) is not None

    with ThreadPoolExecutor(6) as pool:
        assert sorted(pool.map(take, engines)) == [False] * 5 + [True]


def test_a_link_that_is_too_old(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        users.add_user(engine, user())
        sessions.add_link(engine, "l", "id-ada", expires_ns=NOW_NS + 10)
        assert sessions.take_link(engine, "l", now_ns=NOW_NS + 10) is None


def test_links_of_a_user_are_few(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        users.add_user(engine, user())
        for number in range(40):
            sessions.add_link(engine, f"l{number}", "id-ada", expires_ns=NOW_NS + number + 1)
        good = [n for n in range(40) if sessions.take_link(engine, f"l{n}", now_ns=NOW_NS)]
    assert good == list(range(24, 40))


def test_failures_are_kept_by_name_and_address(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        assert sessions.read_failures(engine, "ada", "a") is None
        sessions.write_failures(engine, "ada", "a", Failures(1, NOW_NS, 0))
        sessions.write_failures(engine, "ada", "a", Failures(2, NOW_NS, NOW_NS + 5))
        assert sessions.read_failures(engine, "ada", "a") == Failures(2, NOW_NS, NOW_NS + 5)
        assert sessions.read_failures(engine, "ada", "b") is None
        sessions.clear_failures(engine, "ada", "a")
        assert sessions.read_failures(engine, "ada", "a") is None


def test_the_sweep_takes_what_has_expired_and_bounds_the_rest(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        users.add_user(engine, user())
        for number, seen_ns, expires_ns in (
            (1, NOW_NS, NOW_NS + 99),
            (2, NOW_NS - 60, NOW_NS + 99),
            (3, NOW_NS, NOW_NS),
        ):
            sessions.add_session(engine, replace(session(number), seen_ns=seen_ns, expires_ns=expires_ns), keep=8)
        sessions.add_link(engine, "old", "id-ada", expires_ns=NOW_NS)
        for number in range(20):
            sessions.write_failures(engine, f"w{number}", "a", Failures(1, NOW_NS - number, 0))
        sessions.sweep_sign_ins(engine, now_ns=NOW_NS, idle_ns=60, forget_ns=15, keep=10)
        assert [n for n in (1, 2, 3) if sessions.find_session(engine, f"s{n}")] == [1]
        kept = [n for n in range(20) if sessions.read_failures(engine, f"w{n}", "a")]
    assert kept == list(range(10))


def test_keys_come_back_as_they_went_in(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        users.add_user(engine, user())
        api_keys.add_key(engine, key("k1"))
        api_keys.add_key(engine, replace(key("k2", None), sealed=None, created_ns=NOW_NS + 1))
        assert api_keys.key_and_owner(engine, "k1") == (key("k1"), user())
        assert api_keys.key_and_owner(engine, "k2") == (
            replace(key("k2", None), sealed=None, created_ns=NOW_NS + 1),
            None,
        )
        assert api_keys.key_and_owner(engine, "k3") is None
        assert [item.id for item in api_keys.list_keys(engine, limit=9)] == ["k2", "k1"]
        assert [item.id for item in api_keys.list_keys(engine, user_id="id-ada", limit=9)] == ["k1"]
        assert (api_keys.count_keys(engine, "id-ada"), api_keys.count_keys(engine, None)) == (1, 1)
        api_keys.touch_key(engine, "k1", now_ns=NOW_NS + 7)
        assert api_keys.find_key(engine, "k1") == replace(key("k1"), used_ns=NOW_NS + 7)
        assert api_keys.remove_key(engine, "k1")
        assert not api_keys.remove_key(engine, "k1")
