"""The store's fixtures: what asks for `store_url` runs on both databases."""

from __future__ import annotations

from tests.gateway.store.conftest import store_url

__all__ = ["store_url"]
