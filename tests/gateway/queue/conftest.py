"""Every test of the queue that asks for `world` runs on both databases."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from tests.gateway.queue.world import World
from tests.support.postgres import PostgresServer


@pytest.fixture(params=("sqlite", "postgres"))
async def world(request: pytest.FixtureRequest, tmp_path: Path) -> AsyncIterator[World]:
    """An empty store, a manual clock, and desks on it."""
    url = ""
    if request.param == "postgres":
        server: PostgresServer = request.getfixturevalue("postgres")
        url = server.schema()
    world = World(tmp_path, url)
    yield world
    await world.close()


@pytest.fixture
async def shared_world(tmp_path: Path, postgres: PostgresServer) -> AsyncIterator[World]:
    """The same where several gateways share the database."""
    world = World(tmp_path, postgres.schema())
    yield world
    await world.close()
