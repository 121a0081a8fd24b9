"""Opening what the agent keeps; waiting for a disk that does not work yet."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from pathlib import Path

import pytest

from edge_agent.config.settings import Settings
from edge_agent.state import state as module
from edge_agent.state.state import open_state
from edge_agent.state.state_dir import locked
from metaros.clock import SystemClock
from metaros.errors import ConfigError
from tests.edge_agent.parts import accept
from tests.support.waiting import wait_until_async


async def test_what_was_kept_is_there_again(tmp_path: Path) -> None:
    settings = Settings(name="r", state_dir=tmp_path / "state")
    for held in (0, 1):
        with contextlib.ExitStack() as stack:
            state = await open_state(settings, SystemClock(), stack)
            assert state.outbox.depth("event").samples == held
            assert state.command_log.first_time(b"x") == (held == 0)
            assert state.store_id.value == ("store" if held else "")
            assert state.limit_bytes_per_s == (5000 if held else 0)
            state.outbox.append(1, "event", 7, b"x")
            accept(state.outbox)
            state.store_id.learn("store")
            state.disk.replace("uplink.json", b'{"bytes_per_s": 5000}')
            await state.command_log.close()


async def test_it_waits_for_a_disk_that_works_and_says_so_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(module, "RETRY_S", 0.01)
    (tmp_path / "place").write_text("a file where the directory should be")
    settings = Settings(name="r", state_dir=tmp_path / "place" / "state")
    with contextlib.ExitStack() as stack, caplog.at_level(logging.INFO, "metaros.agent"):
        opening = asyncio.create_task(open_state(settings, SystemClock(), stack))
        try:
            await wait_until_async(lambda: bool(caplog.records))
            for _ in range(5):
                await asyncio.sleep(0.01)
            assert not opening.done()
            (tmp_path / "place").unlink()
            state = await asyncio.wait_for(opening, 60)
        finally:
            opening.cancel()
        assert state.outbox.writer
    first, last = (record.message for record in caplog.records)
    assert "nothing is tapped until it works" in first
    assert last == "the state directory works again"


async def test_waiting_can_be_ended(tmp_path: Path) -> None:
    (tmp_path / "place").write_text("")
    settings = Settings(name="r", state_dir=tmp_path / "place" / "state")
    with contextlib.ExitStack() as stack:
        opening = asyncio.create_task(open_state(settings, SystemClock(), stack))
        await asyncio.sleep(0)
        opening.cancel()
        with pytest.raises(asyncio.CancelledError):
            await opening


async def test_a_failed_try_gives_the_lock_back_and_another_agent_is_no_reason_to_wait(tmp_path: Path) -> None:
    settings = Settings(name="r", state_dir=tmp_path)
    (tmp_path / "outbox").write_text("no directory")
    with contextlib.ExitStack() as stack:
        opening = asyncio.create_task(open_state(settings, SystemClock(), stack))
        await asyncio.sleep(0)
        with locked(tmp_path):
            pass
        opening.cancel()
        await asyncio.gather(opening, return_exceptions=True)
        with locked(tmp_path), pytest.raises(ConfigError):
            await open_state(settings, SystemClock(), stack)
