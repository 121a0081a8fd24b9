"""The database of a test's store: a file; and PostgreSQL, too, for a test that is `on_both`, as SQL is its point."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.support.servers.postgres import PostgresServer
from tests.support.servers.sqlite_store import place_store

__all__ = ["on_both", "store_url"]

on_both = pytest.mark.parametrize(
    "store_url", ["sqlite", pytest.param("postgres", marks=pytest.mark.integration)], indirect=True
)


@pytest.fixture
def store_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """An empty store's URL; "" is a file in `tmp_path`."""
    if getattr(request, "param", "sqlite") == "sqlite":
        place_store(tmp_path)
        return ""
    server: PostgresServer = request.getfixturevalue("postgres")
    return server.schema()
