"""Rules' tests that ask for `store_url` run on both databases."""

from __future__ import annotations

from tests.gateway.store.conftest import store_url

__all__ = ["store_url"]
