"""Two contexts on one router: what crosses between them crosses the wire."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import metaros
from metaros.wire import open_router
from tests.support.ports import free_port


@pytest.fixture
def zenoh_router() -> Iterator[str]:
    """A router that opens at once: the suite's own waits half a second for scouts."""
    with open_router(free_port(), environ={}) as router:
        yield router.endpoint


@pytest.fixture
def here(zenoh_router: str) -> Iterator[metaros.Context]:
    """The context under test."""
    with metaros.Context(domain_id=0, connect=zenoh_router) as context:
        yield context


@pytest.fixture
def there(zenoh_router: str) -> Iterator[metaros.Context]:
    """Its peer."""
    with metaros.Context(domain_id=0, connect=zenoh_router) as context:
        yield context
