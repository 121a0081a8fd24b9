"""The store's fixtures: what asks for `engine`, `connect` or `store_url` runs on both databases."""

from __future__ import annotations

from tests.gateway.store.conftest import connect, engine, store_url

__all__ = ["connect", "engine", "store_url"]
