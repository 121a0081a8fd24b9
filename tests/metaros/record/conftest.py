"""A publisher's and a recorder's context on one router; all tests of a worker share them."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import metaros
from tests.support.nodes.contexts import SharedContexts
from tests.support.servers.routers import zenoh_router


@pytest.fixture(scope="session")
def shared() -> Iterator[SharedContexts]:
    """The router and its contexts."""
    with zenoh_router() as endpoint, SharedContexts(endpoint) as contexts:
        yield contexts


@pytest.fixture
def contexts(shared: SharedContexts) -> Iterator[tuple[metaros.Context, metaros.Context]]:
    """Two of them."""
    with shared.lend("one") as one, shared.lend("other") as other:
        yield one, other
    shared.settle()
