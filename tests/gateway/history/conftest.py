"""`engine` is a file here, as tests/gateway/store has the statements on both databases. What asks for `source` runs on
batches and on segments, and once on PostgreSQL.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.store.engine import StoreEngine
from gateway.store.objects import open_objects
from tests.gateway.history.source import EngineSource, compact_all
from tests.gateway.store.conftest import connect, engine
from tests.support.servers.postgres import PostgresServer
from tests.support.servers.sqlite_store import place_store

__all__ = ["connect", "engine", "form", "source", "store_url"]


@pytest.fixture(params=["batches", "segments", pytest.param("postgres", marks=pytest.mark.integration)])
def form(request: pytest.FixtureRequest) -> str:
    """As what messages are stored."""
    return str(request.param)


@pytest.fixture
def store_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """An empty store's URL."""
    if "source" in request.fixturenames and request.getfixturevalue("form") == "postgres":
        server: PostgresServer = request.getfixturevalue("postgres")
        return server.schema()
    place_store(tmp_path)
    return ""


@pytest.fixture
def source(form: str, engine: StoreEngine, tmp_path: Path) -> Callable[..., EngineSource]:
    """Makes a source of what is committed by then: as it came, or compacted. It may be told another class."""
    objects = open_objects("", tmp_path)

    def made(kind: type[EngineSource] = EngineSource) -> EngineSource:
        if form == "segments":
            assert compact_all(engine, objects)
        return kind(engine, objects)

    return made
