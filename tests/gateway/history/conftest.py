"""Tests that ask for `engine` run on both databases, as those of the store."""

from __future__ import annotations

from tests.gateway.store.conftest import connect, engine, store_url

__all__ = ["connect", "engine", "store_url"]
