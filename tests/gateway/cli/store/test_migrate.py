"""`metaros gateway store migrate`, on SQLite and on PostgreSQL."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from gateway.store.accounts.users import has_admin, list_users
from gateway.store.engines import open_engine
from gateway.store.schema import MIGRATIONS
from tests.support.processes.command_line import call_metaros
from tests.support.servers.postgres import PostgresServer


@pytest.fixture(params=["sqlite", "postgres"])
def url(request: pytest.FixtureRequest) -> str:
    """Where the store is; "" in the data directory."""
    if request.param == "sqlite":
        return ""
    server: PostgresServer = request.getfixturevalue("postgres")
    return server.schema()


def migrate(folder: Path, url: str, *options: str) -> dict[str, Any]:
    """Run it, as the chart does: the URL in the environment."""
    command = ("gateway", "store", "migrate", "--data-dir", str(folder), "-o", "json", *options)
    done = call_metaros(*command, METAROS_STORE=url)
    assert done.code == 0, done.err
    found: dict[str, Any] = json.loads(done.out)
    return found


def test_tables_and_the_first_admin_are_made_once(tmp_path: Path, url: str) -> None:
    assert migrate(tmp_path, url) == {"schema": len(MIGRATIONS), "admin": ""}
    engine, store_id = open_engine(url, tmp_path)
    with engine.transaction(write=False):
        assert not has_admin(engine)
    engine.close()
    assert migrate(tmp_path, url, "--admin") == {"schema": len(MIGRATIONS), "admin": "admin"}
    assert migrate(tmp_path, url, "--admin") == {"schema": len(MIGRATIONS), "admin": ""}
    engine, again = open_engine(url, tmp_path)
    try:
        with engine.transaction(write=False):
            users = [(user.name, user.role.word) for user in list_users(engine, limit=10)]
            (audited,) = engine.fetch("SELECT count(*) FROM audit")
        assert (again, users, audited[0]) == (store_id, [("admin", "admin")], 1)
    finally:
        engine.close()


def test_a_database_that_is_not_there_is_exit_code_2(tmp_path: Path) -> None:
    nowhere = ("--data-dir", str(tmp_path), "--store", "postgresql://nobody@127.0.0.1:1/nothing")
    done = call_metaros("gateway", "store", "migrate", *nowhere)
    assert done.code == 2
    assert "the store at postgresql://127.0.0.1:1/nothing cannot be used" in done.err
