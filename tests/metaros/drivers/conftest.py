"""One context for the drivers of a worker: each test's nodes leave it with the test."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

import metaros
from tests.support.processes.clock_jump import LeapingClock
from tests.support.processes.fast_loop import HurriedClock
from tests.support.servers.routers import zenoh_router


@pytest.fixture(scope="session")
def context() -> Iterator[metaros.Context]:
    """On a router of its own; its clock leaps when told."""
    with zenoh_router() as endpoint, metaros.Context(connect=endpoint, clock=LeapingClock(), environ={}) as opened:
        yield opened


@pytest.fixture(scope="session")
def hurried_context(context: metaros.Context) -> Iterator[metaros.Context]:
    """On the same router, with short seconds: for what plays or is recorded at its own pace."""
    with metaros.Context(connect=context.session.connect, clock=HurriedClock(speed=5.0), environ={}) as opened:
        yield opened
