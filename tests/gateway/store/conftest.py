"""Every test of the store that asks for `engine` or `store_url` runs on both databases."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gateway.store.engine import StoreEngine
from gateway.store.engines import open_engine
from tests.support.postgres import PostgresServer

ENGINES = ("sqlite", "postgres")


@pytest.fixture(params=ENGINES)
def store_url(request: pytest.FixtureRequest) -> str:
    """An empty store's URL; "" is a file."""
    if request.param == "sqlite":
        return ""
    server: PostgresServer = request.getfixturevalue("postgres")
    return server.schema()


@pytest.fixture
def connect(store_url: str, tmp_path: Path) -> Iterator[Callable[[], StoreEngine]]:
    """Opens connections to one store, the first of which makes it."""
    engines: list[StoreEngine] = []

    def opened() -> StoreEngine:
        engines.append(open_engine(store_url, tmp_path)[0])
        return engines[-1]

    yield opened
    for engine in engines:
        engine.close()


@pytest.fixture
def engine(connect: Callable[[], StoreEngine]) -> StoreEngine:
    """A connection to an empty store."""
    return connect()
