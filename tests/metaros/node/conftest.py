"""Two contexts on one router: what crosses between them crosses the wire."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import metaros


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
