"""Two gateways that have met, for all tests of a module that ask for `pair`."""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import replace
from itertools import count
from typing import TYPE_CHECKING

import pytest
import pytest_asyncio

if TYPE_CHECKING:
    from tests.gateway.cluster.gateway_pair import Pair
    from tests.support.servers.postgres import PostgresServer

_numbers = count(1)


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def both(tmp_path_factory: pytest.TempPathFactory, postgres_server: PostgresServer) -> AsyncIterator[Pair]:
    """They run until the module's last test is over."""
    from tests.gateway.cluster.gateway_pair import running_pair

    async with running_pair(tmp_path_factory.mktemp("pair"), postgres_server) as pair:
        yield pair


@pytest.fixture
def pair(both: Pair) -> Pair:
    """They, and a robot that only this test has."""
    return replace(both, robot=f"sim_{next(_numbers)}")
