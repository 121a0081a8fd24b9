"""Every test that asks for `world` runs on both databases."""

from __future__ import annotations

from tests.gateway.queue.conftest import world

__all__ = ["world"]
