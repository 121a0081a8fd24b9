"""Two contexts on one router: what crosses between them crosses the wire. All tests of a worker share them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import metaros
from tests.support.nodes.contexts import SharedContexts
from tests.support.servers.routers import zenoh_router as started_router


@pytest.fixture(scope="session")
def contexts() -> Iterator[SharedContexts]:
    """The router and its contexts."""
    with started_router() as endpoint, SharedContexts(endpoint) as shared:
        yield shared


@pytest.fixture
def zenoh_router(contexts: SharedContexts) -> Iterator[str]:
    """The router's endpoint, for contexts and processes of a test's own."""
    yield contexts.router
    contexts.settle()


@pytest.fixture
def island() -> Iterator[str]:
    """A router of the test's own, for what others' contexts would be seen by."""
    with started_router() as endpoint:
        yield endpoint


@pytest.fixture
def here(contexts: SharedContexts, zenoh_router: str) -> Iterator[metaros.Context]:
    """The context under test."""
    with contexts.lend("here") as context:
        yield context


@pytest.fixture
def there(contexts: SharedContexts, zenoh_router: str) -> Iterator[metaros.Context]:
    """Its peer."""
    with contexts.lend("there") as context:
        yield context
