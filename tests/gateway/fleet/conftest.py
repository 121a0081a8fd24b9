"""Twins and rollouts on a file, and in tests that are `on_both` on PostgreSQL, too."""

from __future__ import annotations

from tests.support.servers.databases import store_url

__all__ = ["store_url"]
