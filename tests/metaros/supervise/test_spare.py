"""The warm spare: it becomes the node that died, fits or is left alone, and leaves nothing behind."""

from __future__ import annotations

import os
import sys
from collections.abc import AsyncIterator
from pathlib import Path

import psutil
import pytest

from metaros.clock import SystemClock, system_rng
from metaros.supervise import Event, EventKind, Launch, Supervisor
from metaros.supervise.spare import ORDER_BYTES, Spare
from tests.support.waiting import wait_until, wait_until_async

NODE = """
import json, os, signal, sys
arguments = sys.argv[1:]
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
if arguments == ["spare"]:
    order = sys.stdin.readline()
    if not order:
        sys.exit(0)
    order = json.loads(order)
    arguments = order["arguments"]
    os.environ.clear()
    os.environ.update(order["env"])
    print("spare", end=" ")
print(*arguments, os.environ.get("WORD"), flush=True)
signal.sigwait([signal.SIGINT])
"""
LONG_S = 60.0


@pytest.fixture
async def spare(tmp_path: Path) -> AsyncIterator[Spare]:
    (tmp_path / "node.py").write_text(NODE)
    made = Spare((sys.executable, "-S", "node.py", "spare"), cwd=tmp_path, env={"PYTHONHASHSEED": "1"})
    yield made
    made.close()


def take(spare: Spare, tmp_path: Path, *arguments: str, **env: str) -> str | None:
    """What the taken spare printed; None where it does not fit."""
    environ = {**os.environ, "PYTHONHASHSEED": "1", **env}
    popen = spare.take(arguments, env=environ, cwd=tmp_path)
    if popen is None:
        return None
    with popen:
        assert popen.stdout is not None
        line = popen.stdout.readline().decode()
        popen.kill()
    return line


async def test_it_becomes_what_it_is_reported(spare: Spare, tmp_path: Path) -> None:
    assert take(spare, tmp_path, "none") is None
    spare.refill()
    first = spare.pid
    spare.refill()
    assert spare.pid == first
    assert take(spare, tmp_path, "a", "b", WORD="x") == "spare a b x\n"
    assert spare.pid is None


async def test_what_does_not_fit_starts_cold(spare: Spare, tmp_path: Path) -> None:
    spare.refill()
    assert take(spare, tmp_path, "a", PYTHONHASHSEED="2") is None
    assert take(spare, tmp_path, "a", LD_LIBRARY_PATH="/somewhere/else") is None
    assert take(spare, tmp_path, "a" * ORDER_BYTES) is None
    assert take(spare, tmp_path.parent, "a") is None
    assert spare.pid is not None


async def test_a_dead_spare_is_no_spare_and_is_replaced(spare: Spare, tmp_path: Path) -> None:
    spare.refill()
    pid = spare.pid
    assert pid is not None
    psutil.Process(pid).kill()
    wait_until(lambda: spare.pid is None, timeout_s=LONG_S)
    assert take(spare, tmp_path, "a") is None
    spare.refill()
    assert take(spare, tmp_path, "a", WORD="x") == "spare a x\n"


async def test_closing_ends_it(spare: Spare) -> None:
    spare.refill()
    pid = spare.pid
    assert pid is not None
    spare.close()
    assert not psutil.pid_exists(pid)


async def test_a_first_restart_is_warm_and_a_crash_loop_cold(spare: Spare, tmp_path: Path) -> None:
    events: list[Event] = []
    lines: list[str] = []
    supervisor = Supervisor(
        clock=SystemClock(),
        rng=system_rng(),
        on_event=events.append,
        on_line=lambda name, text: lines.append(text),
        spare=spare,
    )
    launch = Launch(
        name="a",
        argv=(sys.executable, "-S", "node.py", "a"),
        program_words=3,
        log_path=tmp_path / "a.log",
        env={"WORD": "x", "PYTHONHASHSEED": "1"},
        cwd=tmp_path,
        own_guard=True,
    )
    try:
        supervisor.start([launch])
        for count, text in ((1, "a x"), (2, "spare a x"), (3, "a x")):
            await wait_until_async(lambda count=count: len(lines) == count, timeout_s=LONG_S)  # type: ignore[misc]
            assert lines[-1] == text
            await wait_until_async(lambda: spare.pid is not None, timeout_s=LONG_S)
            (status,) = supervisor.status()
            assert status.pid is not None
            psutil.Process(status.pid).kill()
        await wait_until_async(lambda: len(lines) == 4, timeout_s=LONG_S)
    finally:
        await supervisor.stop(grace_s=1.0)
    assert spare.pid is None
    assert sum(event.kind is EventKind.STARTED for event in events) == 4
