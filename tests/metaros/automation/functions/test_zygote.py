"""The fork server: workers in milliseconds, several at a time, and all of them gone with it or with its gateway."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import sys
from pathlib import Path

import pytest

from metaros.automation.functions.launch import Confinement, Program
from metaros.automation.functions.sandbox.level import Level
from metaros.automation.functions.zygote import Zygote, zygote_works
from metaros.errors import LaunchError
from tests.support.functions.sandboxed_worker import LEVELS, SandboxedWorker, here
from tests.support.processes.processes import started
from tests.support.waiting import wait_until, wait_until_async

pytestmark = [
    pytest.mark.skipif(not zygote_works(), reason="Linux"),
    pytest.mark.asyncio(loop_scope="module"),
]
ROOT = Path(__file__).resolve().parents[4]


def processes_below(pid: int) -> list[int]:
    """All of them, at any depth."""
    found: list[int] = []
    try:
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            found += [int(child), *processes_below(int(child))]
    except OSError:
        return found
    return found


def runs(pid: int) -> bool:
    """Whether it is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.parametrize("level", LEVELS, ids=lambda level: level.name)
async def test_workers_of_one_zygote_answer_and_know_nothing_of_each_other(
    zygote: Zygote, level: Level, tmp_path: Path
) -> None:
    assert await here(level)
    async with (
        SandboxedWorker(level, tmp_path / "a", zygote=zygote) as a,
        SandboxedWorker(level, tmp_path / "b", zygote=zygote) as b,
    ):
        await a.ask("import builtins\nbuiltins.told = 'a'\nresult = 0")
        assert await b.ask("import builtins\nresult = hasattr(builtins, 'told')") is False
        code = "import os\nresult = [os.getuid(), os.environ['AWS_LAMBDA_RUNTIME_API'], os.environ['OWN']]"
        (uid_a, api_a, own), (uid_b, api_b, _) = await a.ask(code), await b.ask(code)
        assert own == "mine"
        if os.geteuid() == 0:
            assert uid_a != uid_b
        assert (api_a == api_b) is (level is Level.L3)  # there each has a loopback of its own
        assert a.launched.pid != b.launched.pid


async def test_many_workers_at_once(zygote: Zygote, tmp_path: Path) -> None:
    cages = [SandboxedWorker(Level.L3, tmp_path / str(index), zygote=zygote) for index in range(8)]
    await asyncio.gather(*(cage.__aenter__() for cage in cages))
    answers = await asyncio.gather(*(cage.ask(f"result = {index}") for index, cage in enumerate(cages)))
    assert answers == list(range(8))
    await asyncio.gather(*(cage.__aexit__(None, None, None) for cage in cages))
    await wait_until_async(lambda: processes_below(zygote.pid) == [])


@pytest.mark.parametrize("level", LEVELS, ids=lambda level: level.name)
async def test_how_a_worker_ends_is_reported(zygote: Zygote, level: Level, tmp_path: Path) -> None:
    ends = {"os._exit(3)": 3, "os.kill(os.getpid(), 9)": -9, "os.kill(os.getpid(), 11)": -11, "os.abort()": -6}
    reported = {}
    for number, code in enumerate(ends):
        async with SandboxedWorker(level, tmp_path / str(number), zygote=zygote) as cage:
            asking = asyncio.ensure_future(cage.ask(f"import os\n{code}"))
            reported[code] = await cage.launched.wait()
            asking.cancel()
            await asyncio.gather(asking, return_exceptions=True)
    assert reported == ends


def code_that_ends_when_reported(folder: Path) -> Path:
    """Of a handler whose worker ends with 3 as soon as there is a file `go` beside it."""
    folder.chmod(0o755)
    (folder / "app.py").write_text("import os\nwhile not os.path.exists('go'):\n    pass\nos._exit(3)\n")
    return folder


def see_one_come_and_go(zygote: Zygote, go: Path) -> None:
    """With this thread's event loop standing still, as on a busy machine."""
    wait_until(lambda: len(processes_below(zygote.pid)) == 2)
    go.touch()
    wait_until(lambda: processes_below(zygote.pid) == [])


@pytest.mark.parametrize("level", [Level.L1, Level.L3], ids=lambda level: level.name)
async def test_a_worker_that_is_gone_before_its_gateway_looks_was_up_all_the_same(
    zygote: Zygote, level: Level, tmp_path: Path
) -> None:
    assert await here(level)
    program = Program(handler="app.handler", code_dir=code_that_ends_when_reported(tmp_path), entry="metaros")
    starting = asyncio.ensure_future(zygote.fork(program, Confinement(level=level, tmp_dir=tmp_path / "tmp")))
    await asyncio.sleep(0)  # it has asked
    see_one_come_and_go(zygote, tmp_path / "go")
    launched = await starting
    try:
        assert await launched.wait() == 3
    finally:
        launched.close()


@pytest.mark.parametrize("level", LEVELS, ids=lambda level: level.name)
async def test_a_killed_zygote_takes_its_workers_along(level: Level, tmp_path: Path) -> None:
    zygote = Zygote()
    await zygote.start()
    cage = await SandboxedWorker(level, tmp_path / "a", zygote=zygote).__aenter__()
    tree = processes_below(zygote.pid)
    assert cage.launched.pid in tree
    os.kill(zygote.pid, signal.SIGKILL)
    assert await cage.launched.wait() == -signal.SIGKILL
    await wait_until_async(lambda: not any(runs(pid) for pid in tree))
    assert not zygote.alive
    program = Program(handler="app.handler", code_dir=cage.code_dir)
    with pytest.raises(LaunchError, match=r"gone|before it was up"):
        await zygote.fork(program, Confinement(level=level, tmp_dir=tmp_path / "b"))
    await cage.__aexit__(None, None, None)
    await zygote.close()


async def test_a_killed_gateway_leaves_no_process(tmp_path: Path) -> None:
    await asyncio.to_thread(kill_a_gateway, tmp_path)


def kill_a_gateway(tmp_path: Path) -> None:
    """And wait until all that it had is gone."""
    levels = [str(int(level)) for level in LEVELS]
    command = [sys.executable, "-m", "tests.support.gateways.killed_gateway", str(tmp_path), *levels]
    with started(command, cwd=ROOT, stderr=None) as gateway:
        assert gateway.stdout is not None
        reported_ids = json.loads(gateway.stdout.readline())
        tree = processes_below(gateway.pid)
        # a server, and one a level; and of each worker its keeper, itself, and two children
        assert len(tree) == 1 + len(LEVELS) + 2 * len(LEVELS) * 4
        assert {reported_ids["zygote"], *reported_ids["keepers"]} <= set(tree)
        gateway.kill()
        gateway.wait()
        wait_until(lambda: not any(runs(pid) for pid in tree))


async def test_a_sandbox_that_cannot_be_made_is_reported_and_leaves_nothing(zygote: Zygote, tmp_path: Path) -> None:
    program = Program(handler="app.handler", code_dir=tmp_path / "missing")
    for level in LEVELS:
        with pytest.raises(LaunchError, match="No such file"):
            await zygote.fork(program, Confinement(level=level, tmp_dir=tmp_path / "tmp"))
    await wait_until_async(lambda: processes_below(zygote.pid) == [])
    huge = Program(handler="app.handler", code_dir=tmp_path, env={"A": "x" * 200_000})
    with pytest.raises(LaunchError, match="at most 131072"):
        await zygote.fork(huge, Confinement(level=Level.L1, tmp_dir=tmp_path / "tmp"))


async def test_a_closed_zygote_forks_no_more(tmp_path: Path) -> None:
    zygote = Zygote()
    await zygote.start()
    pid = zygote.pid
    await zygote.close()
    await zygote.close()
    assert not runs(pid)
    with pytest.raises(LaunchError, match="closed"):
        await zygote.fork(
            Program(handler="a.b", code_dir=tmp_path), Confinement(level=Level.L1, tmp_dir=tmp_path / "t")
        )
