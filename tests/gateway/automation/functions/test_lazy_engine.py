"""The engine's door: what happens where the engine does not come up."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from gateway.automation.functions import lazy_engine
from gateway.automation.functions.errors import FunctionsOffError
from gateway.automation.functions.lazy_engine import LazyEngine
from metaros.automation.functions.engine import Engine
from metaros.clock import SystemClock


async def test_an_engine_that_never_starts_holds_nobody_for_ever(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def start(engine: Engine) -> None:
        await asyncio.Event().wait()

    monkeypatch.setattr(lazy_engine, "START_S", 0.05)
    monkeypatch.setattr(Engine, "start", start)
    authenticator = LazyEngine(
        lambda: Engine(tmp_path, clock=SystemClock()), on_log=lambda piece: None, clock=SystemClock()
    )
    with pytest.raises(FunctionsOffError, match="TimeoutError"):
        await authenticator.open()
    assert authenticator.state().trouble == "TimeoutError"
    await authenticator.close()
