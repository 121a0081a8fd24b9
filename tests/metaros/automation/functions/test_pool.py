"""A function's pool by itself: what becomes of calls that no worker has taken."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from metaros.automation.functions.calls import FunctionSpec, Invocation
from metaros.automation.functions.errors import EngineClosedError
from metaros.automation.functions.pool import Pool
from metaros.automation.functions.running_call import RunningCall
from metaros.clock import ManualClock


class FullCrew:
    """Has room for no worker."""

    def may_start(self, pool: Pool) -> bool:
        return False

    def released(self) -> None:
        """Never."""


async def never(*_: object) -> Any:
    raise AssertionError("no worker may be launched")


async def test_calls_that_wait_when_all_ends_are_reported_why() -> None:
    loop = asyncio.get_running_loop()
    spec = FunctionSpec(key="f", name="f", version="1", arn="", handler="app.handler", code_dir=Path("/nowhere"))
    pool = Pool(spec, entry="metaros", quota=FullCrew(), launch=never, clock=ManualClock())
    over: list[RunningCall] = []
    calls = [
        RunningCall(
            spec, Invocation(request_id=name, payload=b""), loop.create_future(), over.append, None, loop.time()
        )
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
