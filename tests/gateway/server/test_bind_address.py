"""Whose keys are enough to look after a gateway from elsewhere."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from gateway.domain.account import ApiKey, User
from gateway.domain.principal import Role
from gateway.server.bind_address import can_sign_in
from gateway.store.accounts.api_keys import add_key
from gateway.store.accounts.users import add_user
from gateway.store.engines import open_engine
from tests.support.servers.sqlite_store import place_store

END_NS = 1_700_000_000 * 10**9
KEY = ApiKey(id="k", name="ci", user_id=None, role=Role.ADMIN, secret_hash="h")
USER = User(id="u", name="bob", role=Role.OPERATOR, robots=("*",), created_ns=1)


def test_an_admins_key_is_enough_until_it_ends(tmp_path: Path) -> None:
    place_store(tmp_path)
    engine = open_engine("", tmp_path)[0]
    try:
        assert not can_sign_in(engine, now_ns=END_NS)
        with engine.transaction(write=True):
            assert add_user(engine, USER)
            add_key(engine, replace(KEY, role=Role.OPERATOR))
            add_key(engine, replace(KEY, id="own", user_id=USER.id))  # no more than its owner, who is no admin
            add_key(engine, replace(KEY, id="ends", expires_ns=END_NS))
        assert [can_sign_in(engine, now_ns=END_NS - 1), can_sign_in(engine, now_ns=END_NS)] == [True, False]
        with engine.transaction(write=True):
            add_key(engine, replace(KEY, id="stays"))
        assert can_sign_in(engine, now_ns=END_NS)
    finally:
        engine.close()
