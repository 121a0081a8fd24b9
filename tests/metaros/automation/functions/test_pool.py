"""A function's pool by itself: what becomes of calls that no worker has taken."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from metaros.clock import ManualClock
from metaros.functions.calls import FunctionSpec, Invocation
from metaros.functions.faults import EngineClosedError
from metaros.functions.pool import Pool
from metaros.functions.running import Running


class FullCrew:
    """Has room for no worker."""

    def may_start(self, pool: Pool) -> bool:
        return False

    def released(self) -> None:
        """Never."""


async def never(*_: object) -> Any:
    raise AssertionError("no worker may be launched")


async def test_calls_that_wait_when_all_ends_are_told_why() -> None:
    loop = asyncio.get_running_loop()
    spec = FunctionSpec(key="f", name="f", version="1", arn="", handler="app.handler", code_dir=Path("/nowhere"))
    pool = Pool(spec, entry="metaros", crew=FullCrew(), launch=never, clock=ManualClock())
    over: list[Running] = []
    calls = [
        Running(spec, Invocation(request_id=name, payload=b""), loop.create_future(), over.append, None, loop.time())
        for name in ("first", "second")
    ]
    for call in calls:
        pool.submit(call)
    assert (pool.status().waiting, pool.status().workers, pool.load) == (2, 0, 2)
    await pool.close(EngineClosedError("the engine was closed"))
    assert over == calls
    for call in calls:
        with pytest.raises(EngineClosedError, match="the engine was closed"):
            call.done.result()
    assert pool.empty
