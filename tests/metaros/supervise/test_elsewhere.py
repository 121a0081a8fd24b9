"""The ways of platforms without pidfd and without loops that watch pipes, taken here on purpose."""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path

import pytest

from metaros.supervise import Launch, Process, process
from metaros.supervise.logs.output import ThreadOutput
from tests.support.waiting import wait_until_async


@pytest.fixture
def remote(monkeypatch: pytest.MonkeyPatch) -> None:
    """No pidfd, no readers."""
    monkeypatch.delattr(os, "pidfd_open", raising=False)
    monkeypatch.setattr(process, "follow", ThreadOutput)


def launch(tmp_path: Path, code: str) -> Launch:
    """A Python one-liner."""
    return Launch(name="child", argv=(sys.executable, "-S", "-c", code), log_path=tmp_path / "child.log")


@pytest.mark.usefixtures("remote")
async def test_output_and_exit_code(tmp_path: Path) -> None:
    child = Process(launch(tmp_path, "print('one'); print('two', flush=True); raise SystemExit(3)"))
    assert (await child.wait()).code == 3
    assert child.log.tail() == ["one", "two"]
    assert (tmp_path / "child.log").read_bytes() == b"one\ntwo\n"


@pytest.mark.usefixtures("remote")
async def test_output_comes_while_it_runs_and_it_can_be_asked_to_end(tmp_path: Path) -> None:
    code = (
        "import signal as s; s.pthread_sigmask(s.SIG_BLOCK, [s.SIGINT]); print('up', flush=True); "
        "s.sigwait([s.SIGINT]); print('bye', flush=True)"
    )
    child = Process(launch(tmp_path, code))
    await wait_until_async(lambda: child.log.tail() == ["up"])
    child.ask_to_end()
    await asyncio.wait_for(child.wait(), 60)
    assert child.log.tail() == ["up", "bye"]


@pytest.mark.usefixtures("remote")
async def test_a_kill_is_final(tmp_path: Path) -> None:
    child = Process(launch(tmp_path, "print('up', flush=True); input() if 0 else __import__('signal').pause()"))
    await wait_until_async(lambda: child.log.tail() == ["up"])
    child.kill()
    assert (await asyncio.wait_for(child.wait(), 60)).signal == 9
    assert not child.running
