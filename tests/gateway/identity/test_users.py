"""The rules about users and their keys, on both databases."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import pytest

from gateway.domain.account import LAMBDA, User
from gateway.domain.principal import EVERY_ROBOT, Role
from gateway.errors import ForbiddenError, InvalidRequestError, TooManyError
from gateway.identity import keys, users
from gateway.identity.errors import LastAdminError, UnknownKeyError, UnknownUserError, UserExistsError
from gateway.identity.keys import KeyRequest, NewKey, covers, key_principal, key_text, parse_key
from gateway.identity.master import MasterKey
from gateway.identity.sessions import open_session
from gateway.store.accounts import api_keys
from gateway.store.accounts import users as accounts
from gateway.store.accounts.sessions import find_session
from gateway.store.engine import StoreEngine
from gateway.store.ledger import in_transaction
from metaros.limits import LIMITS
from tests.support.servers.databases import on_both
from tests.support.tables import refusal

NOW_NS = 1_700_000_000 * 10**9
MASTER = MasterKey(b"m" * 32)


def add(engine: StoreEngine, name: str, role: Role = Role.OPERATOR, robots: tuple[str, ...] = EVERY_ROBOT) -> User:
    return in_transaction(engine)(
        lambda engine: users.create_user(engine, name, role=role, robots=robots, now_ns=NOW_NS)
    )


def make(engine: StoreEngine, owner: User | None, **wanted: object) -> NewKey:
    request = KeyRequest("ci", Role.VIEWER)._replace(**wanted)
    return in_transaction(engine)(
        lambda engine: keys.create_key(engine, request, owner=owner, master=MASTER, now_ns=NOW_NS)
    )


@on_both
def test_names(engine: StoreEngine) -> None:
    assert add(engine, "ada.l@example-lab+1").name == "ada.l@example-lab+1"
    with pytest.raises(UserExistsError):
        add(engine, "ada.l@example-lab+1")
    for name in ("", "Ada", ".ada", "a b", "a\x00b", "a" * 65, "../x", "ü", "a\n"):
        with pytest.raises(InvalidRequestError):
            add(engine, name)
        with pytest.raises(UnknownUserError):
            in_transaction(engine)(lambda engine, name=name: users.user_named(engine, name))


def test_what_is_no_scope(engine: StoreEngine) -> None:
    scopes = (("sim 1",), ("a;b",), ("",), tuple(f"r{n}" for n in range(65)), ("x" * 300,))
    assert [robots for robots in scopes if not refusal(InvalidRequestError, add, engine, "ada", robots=robots)] == []


@on_both
def test_somebody_can_always_look_after_the_gateway(engine: StoreEngine) -> None:
    run = in_transaction(engine)
    add(engine, "ada", Role.ADMIN)
    add(engine, "bob")
    for change in ({"role": Role.OPERATOR}, {"disabled": True}):
        with pytest.raises(LastAdminError):
            run(lambda engine, change=change: users.change_user(engine, "ada", **change))
    with pytest.raises(LastAdminError):
        run(lambda engine: users.delete_user(engine, "ada"))
    run(lambda engine: users.change_user(engine, "ada", role=Role.ADMIN, disabled=False))
    run(lambda engine: users.change_user(engine, "bob", role=Role.ADMIN))
    run(lambda engine: users.delete_user(engine, "ada"))
    assert [user.name for user in run(lambda engine: accounts.list_users(engine, limit=9))] == ["bob"]


@on_both
def test_two_admins_who_remove_each_other_at_once(connect: Callable[[], StoreEngine]) -> None:
    one, two = connect(), connect()
    for name in ("ada", "bob"):
        add(one, name, Role.ADMIN)
    for _ in range(10):
        for name in ("ada", "bob"):
            in_transaction(one)(lambda engine, name=name: users.change_user(engine, name, role=Role.ADMIN))

        def demote(engine: StoreEngine, name: str) -> str:
            try:
                in_transaction(engine)(lambda engine: users.change_user(engine, name, role=Role.VIEWER))
            except LastAdminError as error:
                return error.code
            return "done"

        with ThreadPoolExecutor(2) as pool:
            ends = sorted(pool.map(demote, (one, two), ("ada", "bob")))
        assert ends == ["done", "last_admin"]
        assert in_transaction(one)(accounts.count_admins) == 1


def test_the_first_admin_is_made_once(engine: StoreEngine) -> None:
    run = in_transaction(engine)
    add(engine, "admin", Role.VIEWER)  # somebody had the name
    first = run(lambda engine: users.first_admin(engine, now_ns=NOW_NS))
    assert (first.name, first.role, first.password) == ("admin1", Role.ADMIN, "")
    assert run(lambda engine: users.first_admin(engine, now_ns=NOW_NS)) == first


def test_a_new_password_ends_the_other_sessions(engine: StoreEngine) -> None:
    run = in_transaction(engine)
    user = add(engine, "ada")
    tokens = [run(lambda engine: open_session(engine, user, now_ns=NOW_NS)).token for _ in range(3)]
    ids = [keys.secret_hash(token) for token in tokens]
    run(lambda engine: users.change_user(engine, "ada", password_hash="h", but_session=ids[1]))
    assert [bool(run(lambda engine, item=item: find_session(engine, item))) for item in ids] == [False, True, False]
    run(lambda engine: users.change_user(engine, "ada", disabled=True))
    assert run(lambda engine: find_session(engine, ids[1])) is None


def test_an_admin_sees_every_robot(engine: StoreEngine) -> None:
    """Or it could make a user, or a link for one, who sees what it does not."""
    run = in_transaction(engine)
    add(engine, "ada", Role.ADMIN)
    add(engine, "bob", Role.OPERATOR, ("sim_*",))
    with pytest.raises(InvalidRequestError, match="every robot"):
        add(engine, "eve", Role.ADMIN, ("sim_*",))
    with pytest.raises(InvalidRequestError, match="every robot"):
        make(engine, None, role=Role.ADMIN, robots=("sim_1",))
    for name, change in (("ada", {"robots": ("sim_*",)}), ("bob", {"role": Role.ADMIN})):
        with pytest.raises(InvalidRequestError, match="every robot"):
            run(lambda engine, name=name, change=change: users.change_user(engine, name, **change))
    run(lambda engine: users.change_user(engine, "bob", role=Role.ADMIN, robots=EVERY_ROBOT))


def test_the_form_of_a_key(engine: StoreEngine) -> None:
    made = make(engine, None)
    assert parse_key(made.text) == (made.key.id, made.secret)
    assert made.text == f"mrk_{made.key.id}_{made.secret}" == key_text(made.key.id, made.secret)
    assert len(made.text) == 85
    for text in ("", "mrk_", made.text[:-1], made.text + "0", made.text.upper(), f" {made.text}", made.text + "\n"):
        assert parse_key(text) is None
    stored = in_transaction(engine)(lambda engine: api_keys.find_key(engine, made.key.id))
    assert stored is not None
    assert made.secret not in repr(stored)
    assert stored.secret_hash == keys.secret_hash(made.secret)
    assert stored.sealed is None


def test_only_a_lambda_key_s_secret_can_be_had_again(engine: StoreEngine) -> None:
    run = in_transaction(engine)
    made = make(engine, None, role=Role.OPERATOR, scopes=frozenset({LAMBDA}))
    stored = in_transaction(engine)(lambda engine: api_keys.find_key(engine, made.key.id))
    assert stored is not None
    assert stored.sealed is not None
    assert made.secret.encode() not in stored.sealed
    found = run(lambda engine: keys.key_secret(engine, made.key.id, MASTER, now_ns=NOW_NS))
    assert found is not None
    assert (found[0].id, found[0].scopes, found[1]) == (made.key.id, {LAMBDA}, made.secret)
    plain = make(engine, None)
    for key_id in (plain.key.id, "0" * 16, "x", "'; --"):
        assert run(lambda engine, key_id=key_id: keys.key_secret(engine, key_id, MASTER, now_ns=NOW_NS)) is None
    run(lambda engine: keys.revoke_key(engine, made.key.id))
    assert run(lambda engine: keys.key_secret(engine, made.key.id, MASTER, now_ns=NOW_NS)) is None


def test_a_key_never_reaches_further_than_who_made_it(engine: StoreEngine) -> None:
    ada = add(engine, "ada", Role.OPERATOR, ("sim_*", "arm"))
    make(engine, ada, role=Role.OPERATOR, robots=("sim_1", "arm"))
    make(engine, ada, robots=("sim_*",))
    with pytest.raises(ForbiddenError):
        make(engine, ada, role=Role.ADMIN)
    for robots in (EVERY_ROBOT, ("sim_1*",), ("other",), ("sim_1", "**"), ("arm*",)):
        with pytest.raises(ForbiddenError):
            make(engine, ada, robots=robots)


def test_keys_that_reach_too_far_go_when_their_user_loses_rights(engine: StoreEngine) -> None:
    run = in_transaction(engine)
    ada = add(engine, "ada", Role.OPERATOR)
    kept = make(engine, ada, robots=("sim_1",)).key.id
    make(engine, ada, robots=("arm",))
    make(engine, ada, role=Role.OPERATOR, robots=("sim_1",))
    other = make(engine, None, role=Role.ADMIN).key.id
    run(lambda engine: users.change_user(engine, "ada", role=Role.VIEWER, robots=("sim_*",)))
    assert {key.id for key in run(lambda engine: api_keys.list_keys(engine, limit=9))} == {kept, other}


def test_who_a_key_is(engine: StoreEngine) -> None:
    ada = add(engine, "ada", Role.OPERATOR)
    key = make(engine, ada, role=Role.OPERATOR, robots=("sim_1",), expires_s=10.0).key
    found = key_principal(key, ada, now_ns=NOW_NS)
    assert found is not None
    assert (found.kind, found.id, found.role, found.robots, found.csrf) == (
        "key",
        key.id,
        Role.OPERATOR,
        ("sim_1",),
        "",
    )
    lesser = key_principal(key, replace(ada, role=Role.VIEWER), now_ns=NOW_NS)
    assert lesser is not None
    assert lesser.role is Role.VIEWER
    assert key_principal(key, replace(ada, disabled=True), now_ns=NOW_NS) is None
    assert key_principal(key, None, now_ns=NOW_NS) is None
    assert key_principal(key, ada, now_ns=NOW_NS + 10 * 10**9 - 1) is not None
    assert key_principal(key, ada, now_ns=NOW_NS + 10 * 10**9) is None


@on_both
def test_keys_are_few_and_well_formed(engine: StoreEngine) -> None:
    ada = add(engine, "ada")
    for wrong in ({"name": ""}, {"name": "x" * 65}, {"name": "a\nb"}, {"scopes": frozenset({"root"})}):
        with pytest.raises(InvalidRequestError):
            make(engine, ada, **wrong)
    for expires_s in (0.0, -1.0, float("nan"), float("inf"), LIMITS.key_life_s + 1):
        with pytest.raises(InvalidRequestError):
            make(engine, ada, expires_s=expires_s)
    for _ in range(LIMITS.keys_per_user):
        made = make(engine, ada)
    with pytest.raises(TooManyError):
        make(engine, ada)
    in_transaction(engine)(lambda engine: keys.revoke_key(engine, made.key.id, user_id=ada.id))
    make(engine, ada)


def test_nobody_revokes_somebody_else_s_key(engine: StoreEngine) -> None:
    ada, bob = add(engine, "ada"), add(engine, "bob")
    key_id = make(engine, ada).key.id
    run = in_transaction(engine)
    for wrong in (key_id[:-1], "nothing", "0" * 16):
        with pytest.raises(UnknownKeyError):
            run(lambda engine, wrong=wrong: keys.revoke_key(engine, wrong))
    with pytest.raises(UnknownKeyError):
        run(lambda engine: keys.revoke_key(engine, key_id, user_id=bob.id))
    assert run(lambda engine: keys.revoke_key(engine, key_id, user_id=ada.id)).name == "ci"


@pytest.mark.parametrize(
    ("wide", "narrow", "covered"),
    [
        (("*",), ("anything", "*"), True),
        (("sim_*",), ("sim_1", "sim_*"), True),
        (("sim_*",), ("sim_1*",), False),
        (("sim_*",), ("*",), False),
        (("a", "b"), ("a",), True),
        (("a",), ("a", "b"), False),
        ((), ("a",), False),
        (("a",), (), True),
    ],
)
def test_what_covers_what(wide: tuple[str, ...], narrow: tuple[str, ...], covered: bool) -> None:
    assert covers(wide, narrow) is covered
