"""The supervisor with real, small children: killed, hung, crashing, orphaned."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
import textwrap
from collections.abc import AsyncIterator
from pathlib import Path

import psutil
import pytest

from metaros.clock import SystemClock, system_rng
from metaros.errors import ConfigError
from metaros.supervise import Event, EventKind, Launch, RestartPolicy, Supervisor
from metaros.supervise.restart_policy import Restart
from tests.support.nodes.node_code import DEAF, SLEEP
from tests.support.processes.processes import started
from tests.support.waiting import wait_until, wait_until_async


class Rig:
    """A supervisor, its events, and launches of Python one-liners."""

    def __init__(self, tmp_path: Path) -> None:
        self.tmp_path = tmp_path
        self.events: list[Event] = []
        self.supervisor = Supervisor(clock=SystemClock(), rng=system_rng(), on_event=self.events.append)

    def launch(self, name: str, code: str, *, stage: int = 0, policy: RestartPolicy | None = None) -> Launch:
        return Launch(
            name=name,
            argv=(sys.executable, "-S", "-c", code),
            log_path=self.tmp_path / f"{name}.log",
            stage=stage,
            policy=policy or RestartPolicy(),
        )

    def start(self, *launches: Launch) -> None:
        self.supervisor.start(launches)

    def kinds(self, name: str) -> list[EventKind]:
        return [event.kind for event in self.events if event.name == name]

    def pid(self, name: str) -> int:
        (pid,) = (status.pid for status in self.supervisor.status() if status.name == name)
        assert pid is not None
        return pid

    async def up(self, name: str) -> None:
        log = self.tmp_path / f"{name}.log"
        await wait_until_async(lambda: log.exists() and b"up" in log.read_bytes())


@pytest.fixture
async def rig(tmp_path: Path) -> AsyncIterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    await rig.supervisor.stop(grace_s=1.0)


async def test_a_killed_child_is_back_at_once(rig: Rig) -> None:
    rig.start(rig.launch("a", SLEEP))
    await rig.up("a")
    first = rig.pid("a")
    os.kill(first, signal.SIGKILL)
    await wait_until_async(lambda: rig.kinds("a").count(EventKind.STARTED) == 2, timeout_s=60)
    assert rig.pid("a") != first
    assert rig.kinds("a") == [EventKind.STARTED, EventKind.EXITED, EventKind.RESTARTING, EventKind.STARTED]
    assert [event.detail for event in rig.events if event.kind is EventKind.EXITED] == ["killed by SIGKILL"]
    assert [status.restarts for status in rig.supervisor.status()] == [1]


async def test_the_last_line_says_why(rig: Rig) -> None:
    once = RestartPolicy(restart=Restart.NEVER)
    rig.start(
        rig.launch("a", "import sys; print('starting', flush=True); sys.exit('no camera at /dev/video7')", policy=once)
    )
    await wait_until_async(lambda: EventKind.ENDED in rig.kinds("a"))
    assert rig.events[1].detail == "exit code 1: no camera at /dev/video7"
    assert [status.state for status in rig.supervisor.status()] == ["ended"]
    assert rig.supervisor.tail("a") == ["starting", "no camera at /dev/video7"]


async def test_a_configuration_error_is_not_repeated(rig: Rig) -> None:
    rig.start(rig.launch("a", "raise SystemExit(78)"))
    await wait_until_async(lambda: EventKind.ENDED in rig.kinds("a"))
    assert rig.kinds("a") == [EventKind.STARTED, EventKind.EXITED, EventKind.ENDED]


async def test_a_missing_program_is_an_exit_not_an_exception(rig: Rig, tmp_path: Path) -> None:
    never = RestartPolicy(restart=Restart.NEVER)
    rig.start(Launch(name="a", argv=("/no/such/program",), log_path=tmp_path / "a.log", policy=never))
    await wait_until_async(lambda: EventKind.ENDED in rig.kinds("a"))
    assert "No such file" in rig.events[1].detail


async def test_a_crash_loop_ends_in_quarantine(rig: Rig) -> None:
    policy = RestartPolicy(base_delay_s=0.001, max_delay_s=0.002, first_jitter_s=0.0, window_exits=3)
    rig.start(rig.launch("a", "raise SystemExit(1)", policy=policy))
    await wait_until_async(lambda: EventKind.QUARANTINED in rig.kinds("a"))
    assert rig.kinds("a").count(EventKind.STARTED) == 4
    assert [status.state for status in rig.supervisor.status()] == ["quarantined"]


async def test_stages_stop_in_falling_order(rig: Rig) -> None:
    rig.start(*(rig.launch(name, SLEEP, stage=stage) for stage, name in enumerate("abc")))
    for name in "abc":
        await rig.up(name)
    await rig.supervisor.stop(grace_s=5.0)
    stopped = [event.name for event in rig.events if event.kind is EventKind.STOPPED]
    assert stopped == ["c", "b", "a"]


async def test_a_hung_child_is_killed_when_the_grace_is_over(rig: Rig) -> None:
    rig.start(rig.launch("bad", DEAF, stage=1), rig.launch("good", SLEEP))
    await rig.up("bad")
    await rig.up("good")
    pids = [rig.pid("bad"), rig.pid("good")]
    await rig.supervisor.stop(grace_s=0.6)
    assert rig.kinds("bad")[-1] is EventKind.KILLED
    assert rig.kinds("good")[-1] is EventKind.STOPPED
    assert not any(psutil.pid_exists(pid) for pid in pids)


async def test_kill_ends_a_stop_that_takes_too_long(rig: Rig) -> None:
    rig.start(rig.launch("a", DEAF))
    await rig.up("a")
    stopping = asyncio.create_task(rig.supervisor.stop(grace_s=60.0))
    await asyncio.sleep(0)
    rig.supervisor.kill()
    await asyncio.wait_for(stopping, 60)
    assert [status.last_exit for status in rig.supervisor.status()] == ["killed by SIGKILL"]


async def test_a_suspended_child_is_killed_too(rig: Rig) -> None:
    rig.start(rig.launch("a", SLEEP))
    await rig.up("a")
    os.kill(rig.pid("a"), signal.SIGSTOP)
    await rig.supervisor.stop(grace_s=0.3)
    assert rig.kinds("a")[-1] is EventKind.KILLED


async def test_what_a_dead_child_left_in_its_group_goes_with_it(rig: Rig, tmp_path: Path) -> None:
    code = f"""
        import subprocess, sys
        child = subprocess.Popen([sys.executable, "-S", "-c", "import signal; signal.pause()"])
        open({str(tmp_path / "pid")!r}, "w").write(str(child.pid))
        raise SystemExit(1)
    """
    rig.start(rig.launch("a", textwrap.dedent(code), policy=RestartPolicy(restart=Restart.NEVER)))
    await wait_until_async(lambda: EventKind.ENDED in rig.kinds("a"))
    grandchild = int((tmp_path / "pid").read_text())
    await wait_until_async(lambda: not _alive(grandchild))


async def test_no_restart_while_stopping(rig: Rig) -> None:
    slow = RestartPolicy(first_jitter_s=0.0, base_delay_s=60.0, jitter=0.0)
    rig.start(rig.launch("a", "raise SystemExit(1)", policy=slow))
    await wait_until_async(lambda: rig.kinds("a").count(EventKind.EXITED) == 2)
    await rig.supervisor.stop(grace_s=1.0)
    assert [status.state for status in rig.supervisor.status()] == ["stopped"]
    assert rig.kinds("a").count(EventKind.STARTED) == 2


async def test_two_processes_of_one_name_are_refused(rig: Rig) -> None:
    rig.start(rig.launch("a", SLEEP))
    with pytest.raises(ConfigError, match="'a'"):
        rig.start(rig.launch("a", SLEEP))


async def test_a_flood_of_output_stays_bounded_and_blocks_nobody(rig: Rig, tmp_path: Path) -> None:
    code = "import sys\nfor _ in range(3000): sys.stdout.write('x' * 1000 + '\\n')"
    launch = Launch(
        name="a",
        argv=(sys.executable, "-S", "-c", code),
        log_path=tmp_path / "a.log",
        policy=RestartPolicy(restart=Restart.NEVER),
        log_bytes=100_000,
    )
    rig.start(launch)
    await wait_until_async(lambda: EventKind.ENDED in rig.kinds("a"))
    assert (tmp_path / "a.log").stat().st_size <= 100_000
    assert (tmp_path / "a.log.1").stat().st_size <= 100_000


OWNER = """
    import asyncio, sys
    from pathlib import Path
    from metaros.clock import SystemClock, system_rng
    from metaros.supervise import Launch, Supervisor

    async def main():
        supervisor = Supervisor(clock=SystemClock(), rng=system_rng())
        code = {hang!r}
        supervisor.start(
            Launch(name=name, argv=(sys.executable, "-S", "-c", code), log_path=Path({folder!r}) / (name + ".log"))
            for name in ("a", "b")
        )
        await asyncio.sleep(0.2)
        print(*[status.pid for status in supervisor.status()], flush=True)
        await asyncio.sleep(60)

    asyncio.run(main())
"""


@pytest.mark.skipif(sys.platform != "linux", reason="the parent-death signal is Linux's")
def test_kill_9_of_the_supervisor_leaves_no_orphan(tmp_path: Path) -> None:
    code = textwrap.dedent(OWNER).format(hang=DEAF, folder=str(tmp_path))
    with started([sys.executable, "-c", code], stderr=None) as owner:
        assert owner.stdout is not None
        pids = [int(word) for word in owner.stdout.readline().split()]
        assert len(pids) == 2
        wait_until(lambda: all("up" in (tmp_path / f"{name}.log").read_text() for name in "ab"))
        owner.kill()
        owner.wait()
        wait_until(lambda: not any(_alive(pid) for pid in pids), timeout_s=60)


def _alive(pid: int) -> bool:
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
