"""The queue's worlds: its logic on a file, what gateways share on PostgreSQL, and what asks for `any_world` on both.

The statements themselves are tested on both in tests/gateway/store/automation/test_deliveries.py.
"""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.gateway.automation.queue.world import World
from tests.support.servers.postgres import PostgresServer


@pytest.fixture
async def world(tmp_path: Path) -> AsyncIterator[World]:
    """An empty store, a manual clock, and desks on it."""
    world = World(tmp_path, "")
    yield world
    await world.close()


@pytest.fixture
async def shared_world(tmp_path: Path, postgres: PostgresServer) -> AsyncIterator[World]:
    """The same where several gateways share the database."""
    world = World(tmp_path, postgres.schema())
    yield world
    await world.close()


@pytest.fixture(params=["world", pytest.param("shared_world", marks=pytest.mark.integration)])
def any_world(request: pytest.FixtureRequest) -> World:
    """Each of them."""
    found: World = request.getfixturevalue(request.param)
    return found
