"""Functions on a file, and in tests that are `on_both` on PostgreSQL, too."""

from __future__ import annotations

from tests.gateway.automation.queue.conftest import world
from tests.support.servers.databases import store_url

__all__ = ["store_url", "world"]
