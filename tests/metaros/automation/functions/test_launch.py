"""Workers by exec: environment, layers, output and log, their end; and the plain process of other systems."""

from __future__ import annotations

import asyncio
import os
import signal
import struct
from pathlib import Path

import pytest

from metaros.automation.functions.launch import Confinement, Program, launch
from metaros.automation.functions.plain_process import launch_plain
from metaros.automation.functions.sandbox.level import Level
from metaros.errors import LaunchError
from tests.support.functions.sandboxed_worker import LEVELS, SandboxedWorker
from tests.support.waiting import wait_until_async

ALL = (Level.L0, *LEVELS)


@pytest.mark.parametrize("level", ALL, ids=lambda level: level.name)
async def test_a_worker_answers_prints_and_ends(level: Level, tmp_path: Path) -> None:
    async with SandboxedWorker(level, tmp_path / "a") as cage:
        assert await cage.ask("print('said')\nresult = 6 * 7") == 42
        assert await cage.ask("import os\nresult = 0 in os.getresuid()") is False  # no function is ever root
        assert cage.output() == b"said\n"
        cage.launched.kill()
        cage.launched.kill()
        assert await cage.launched.wait() == -signal.SIGKILL
        cage.launched.kill()


@pytest.mark.parametrize("level", ALL, ids=lambda level: level.name)
async def test_code_and_layers_are_where_the_handler_looks(level: Level, tmp_path: Path) -> None:
    code, first, second = (tmp_path / name for name in ("code", "first", "second"))
    for folder in (code, first / "python", second / "python", second / "bin"):
        folder.mkdir(parents=True)
    (code / "app.py").write_text(
        "import os, shutil, sys, low, high\n"
        "print(low.FROM, high.FROM, shutil.which('tool') is not None, os.getcwd() == os.environ['LAMBDA_TASK_ROOT'],"
        " os.environ['TZ'], os.environ['_HANDLER'], flush=True)\nos._exit(7)\n"
    )
    (first / "python" / "low.py").write_text("FROM = 'first'")
    (first / "python" / "high.py").write_text("FROM = 'first'")
    (second / "python" / "high.py").write_text("FROM = 'second'")  # the later layer counts
    (second / "bin" / "tool").write_text("#!/bin/sh\n")
    (second / "bin" / "tool").chmod(0o755)
    program = Program(
        handler="app.handler", code_dir=code, layer_dirs=(first, second), env={"TZ": "Europe/Paris", "HOME": "/nowhere"}
    )
    launched = await launch(program, Confinement(level=level, tmp_dir=tmp_path / "tmp"))
    assert await launched.wait() == 7
    assert launched.output is not None
    assert os.read(launched.output, 4096) == b"first second True True Europe/Paris app.handler\n"
    launched.close()


async def test_the_log_is_framed(tmp_path: Path) -> None:
    async with SandboxedWorker(Level.L3, tmp_path / "a") as cage:
        await cage.ask("import logging\nlogging.getLogger().warning('one\\ntwo')\nresult = 0")
        assert cage.launched.logs is not None
        frame = os.read(cage.launched.logs, 4096)
        kind, length, _ = struct.unpack(">IIQ", frame[:16])
        assert kind >> 16 == 0xA55A
        assert length == len(frame) - 16
        assert b"one\ntwo" in frame


async def test_a_plain_process_as_on_other_systems(tmp_path: Path) -> None:
    (tmp_path / "app.py").write_text("import os\nprint(os.environ['OWN'], 'PATH' in os.environ)\nos._exit(7)")
    program = Program(handler="app.handler", code_dir=tmp_path, env={"OWN": "mine"}, entry="metaros")
    for level in (Level.L0, Level.L1):
        launched = await launch_plain(program, Confinement(level=level, tmp_dir=tmp_path / "tmp"))
        assert launched.logs is None
        assert await launched.wait() == 7
        assert launched.output is not None
        assert os.read(launched.output, 100) == b"mine True\n"
        launched.close()


async def test_closing_kills(tmp_path: Path) -> None:
    cage = await SandboxedWorker(Level.L3, tmp_path / "a").__aenter__()
    pid = cage.launched.pid
    await cage.__aexit__(None, None, None)
    cage.launched.close()
    await wait_until_async(lambda: not Path(f"/proc/{pid}").exists())


async def test_a_given_user_is_taken_and_root_is_refused(tmp_path: Path) -> None:
    if os.geteuid() != 0:
        pytest.skip("only root becomes somebody else")
    async with SandboxedWorker(Level.L2, tmp_path / "a", uid=65534, gid=65534) as cage:
        assert await cage.ask("import os\nresult = [*os.getresuid(), *os.getresgid()]") == [65534] * 6
    for level in LEVELS:
        program = Program(handler="app.handler", code_dir=tmp_path / "a" / "code")
        with pytest.raises(LaunchError, match="must not be root"):
            await launch(program, Confinement(level=level, tmp_dir=tmp_path / "b", uid=0, gid=0))


async def test_a_cancelled_launch_leaves_nothing(tmp_path: Path) -> None:
    program = Program(handler="none.none", code_dir=tmp_path, entry="none")
    before = children()
    for rounds in range(1, 6):
        task = asyncio.ensure_future(launch(program, Confinement(level=Level.L3, tmp_dir=tmp_path / "tmp")))
        for _ in range(rounds):
            await asyncio.sleep(0)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
    await wait_until_async(lambda: children() == before)


def children() -> str:
    """Our own processes."""
    return Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text()
