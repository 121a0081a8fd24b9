"""What asks for `engine` or `store_url` runs on both databases, with `objects` beside them: a directory, and S3."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from gateway.store.engine import StoreEngine
from gateway.store.engines import open_engine
from gateway.store.objects import ObjectStore, open_objects
from tests.support.servers.postgres import PostgresServer
from tests.support.servers.sqlite_store import place_store

ENGINES = ("sqlite", pytest.param("postgres", marks=pytest.mark.integration))


@pytest.fixture(params=ENGINES)
def store_url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    """An empty store's URL; "" is a file in `tmp_path`."""
    if request.param == "sqlite":
        place_store(tmp_path)
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


@pytest.fixture
def objects(request: pytest.FixtureRequest, store_url: str, tmp_path: Path) -> Iterator[ObjectStore]:
    """An empty object store: a directory beside a file, a bucket beside a database that gateways share."""
    store = open_objects(request.getfixturevalue("s3_url")() if store_url else "", tmp_path)
    yield store
    store.close()
