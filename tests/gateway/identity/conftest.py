"""The store's fixtures: on a file, and in tests that are `on_both` on PostgreSQL, too."""

from __future__ import annotations

from tests.gateway.store.conftest import connect, engine
from tests.support.servers.databases import store_url

__all__ = ["connect", "engine", "store_url"]
