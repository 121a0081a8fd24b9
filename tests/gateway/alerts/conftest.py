"""Every test that asks for `store_url` runs on both databases."""

from __future__ import annotations

import pytest

from tests.support.postgres import PostgresServer


@pytest.fixture(params=("sqlite", "postgres"))
def store_url(request: pytest.FixtureRequest) -> str:
    """An empty store's URL; "" is a file."""
    if request.param == "sqlite":
        return ""
    server: PostgresServer = request.getfixturevalue("postgres")
    return server.schema()


@pytest.fixture
def shared_url(postgres: PostgresServer) -> str:
    """An empty store that several gateways may share."""
    return postgres.schema()
