"""A fork server that the tests of a file share: their workers come from it, and none of them ends it."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest_asyncio

from metaros.automation.functions.zygote import Zygote


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def zygote() -> AsyncIterator[Zygote]:
    server = Zygote()
    await server.start()
    yield server
    await server.close()
