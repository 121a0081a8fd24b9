"""The identity manager beside a store that is away: the trouble is told once, and what follows it is followed."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from gateway.errors import StoreError
from gateway.identity import manager as module
from gateway.identity.manager import IdentityChoices, IdentityManager
from metaros.clock import ManualClock


async def test_authorities_that_cannot_be_followed_are_reported_once_until_they_can(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "FOLLOW_S", 0.0)
    store: Any = SimpleNamespace(store_id="s" * 32)
    manager = IdentityManager(store, tmp_path, IdentityChoices(), clock=ManualClock())
    ends = ["away", "away", "full", "full", "", "full"]

    async def follow() -> bool:
        if not ends:
            await asyncio.Event().wait()
        if end := ends.pop(0):
            raise StoreError(end)
        return False

    monkeypatch.setattr(manager.authorities, "follow", follow)
    with caplog.at_level(logging.WARNING):
        following = asyncio.create_task(manager._follow_authorities())
        for _ in range(40):
            await asyncio.sleep(0)
        assert not following.done()
        following.cancel()
        await asyncio.gather(following, return_exceptions=True)
    said = "the fleet's authorities cannot be followed now: "
    assert [record.message for record in caplog.records] == [said + end for end in ("away", "full", "full")]
