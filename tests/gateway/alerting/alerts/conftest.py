"""Alerts on a file, and in tests that are `on_both` on PostgreSQL, too."""

from __future__ import annotations

import pytest

from tests.support.servers.databases import store_url
from tests.support.servers.postgres import PostgresServer

__all__ = ["store_url"]


@pytest.fixture
def shared_url(postgres: PostgresServer) -> str:
    """An empty store that several gateways may share."""
    return postgres.schema()
