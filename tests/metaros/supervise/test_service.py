"""The supervisor as a service, with real children: a table that changes, hands that stop, leases that end."""

from __future__ import annotations

import asyncio
import os
import signal
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from metaros.clock import SystemClock, boot_s, system_rng
from metaros.errors import ConfigError, UnavailableError
from metaros.supervise.node_table_file import TableFile, read_rows
from metaros.supervise.service import NodeService
from tests.support.nodes.node_code import DEAF, SLEEP
from tests.support.waiting import wait_until_async


def row(name: str, code: str = SLEEP, **values: Any) -> dict[str, Any]:
    return {"name": name, "argv": [sys.executable, "-S", "-c", code], "stop_grace_s": 2.0, **values}


class Rig:
    """A service on a directory, made again as often as a test wants."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.service = self.make()
        self.ahead_s = 0.0

    def make(self) -> NodeService:
        return NodeService(
            self.directory, clock=SystemClock(), rng=system_rng(), lease_s=lambda: boot_s() + self.ahead_s
        )

    async def table(self, *rows: dict[str, Any]) -> None:
        await self.service.set_table(read_rows(list(rows)))

    async def again(self) -> None:
        """The supervisor ends and comes back."""
        await self.service.stop(grace_s=5.0)
        self.service = self.make()
        self.service.start()

    def node(self, name: str) -> dict[str, Any]:
        return next(node for node in self.service.list_()["nodes"] if node["name"] == name)

    async def pid(self, name: str) -> int:
        await wait_until_async(lambda: self.node(name)["pid"] is not None)
        return int(self.node(name)["pid"])

    async def until(self, name: str, state: str) -> None:
        await wait_until_async(lambda: self.node(name)["state"] == state)

    async def up(self, name: str) -> None:
        path = self.service.log_path(name)
        await wait_until_async(lambda: path.exists() and b" up\n" in path.read_bytes())


@pytest.fixture
async def rig(tmp_path: Path) -> AsyncIterator[Rig]:
    rig = Rig(tmp_path)
    rig.service.start()
    yield rig
    await rig.service.stop(grace_s=1.0)


async def test_only_what_changed_is_started_again(rig: Rig) -> None:
    await rig.table(row("a"), row("b"), row("c"))
    pids = {name: await rig.pid(name) for name in "abc"}
    await rig.table(row("a"), row("b", env={"X": "1"}), row("d"))
    assert await rig.pid("a") == pids["a"]
    assert await rig.pid("b") != pids["b"]
    assert await rig.pid("d")
    assert [node["name"] for node in rig.service.list_()["nodes"]] == ["a", "b", "d"]
    assert not psutil.pid_exists(pids["c"])


async def test_the_same_table_again_touches_nobody(rig: Rig) -> None:
    await rig.table(row("a"), row("b", after=["a"]))
    pids = [await rig.pid("a"), await rig.pid("b")]
    await rig.table(row("a"), row("b", after=["a"]))
    assert [await rig.pid("a"), await rig.pid("b")] == pids


@pytest.mark.skipif(sys.platform == "win32", reason="nice values are POSIX's")
async def test_nice_and_critical_change_without_a_restart(rig: Rig) -> None:
    await rig.table(row("a"))
    pid = await rig.pid("a")
    await rig.table(row("a", nice=7, critical=True, stop_grace_s=1.0))
    assert await rig.pid("a") == pid
    assert os.getpriority(os.PRIO_PROCESS, pid) == 7
    assert rig.node("a")["critical"] is True


async def test_a_table_that_cannot_be_kept_changes_nothing(rig: Rig) -> None:
    await rig.table(row("a"))
    (rig.directory / "supervisor.json.tmp").mkdir()
    with pytest.raises(OSError, match="supervisor"):
        await rig.table(row("b"))
    assert rig.node("a")["state"] == "running"
    assert len(rig.service.list_()["nodes"]) == 1


async def test_it_comes_back_alone_with_its_table(rig: Rig) -> None:
    await rig.table(row("a"), row("b", run=False))
    first = await rig.pid("a")
    await rig.again()
    await rig.up("a")
    assert await rig.pid("a") != first
    assert rig.node("b")["state"] == "stopped"
    assert rig.node("b")["why"] == "not to run"


async def test_a_hand_holds_over_tables_and_restarts(rig: Rig) -> None:
    await rig.table(row("a"))
    await rig.service.stop_node("a")
    assert rig.node("a")["why"] == "by hand"
    await rig.table(row("a", env={"X": "1"}))
    assert rig.node("a")["state"] == "stopped"
    await rig.again()
    assert rig.node("a")["state"] == "stopped"
    with pytest.raises(ConfigError, match="start it"):
        await rig.service.retry_node("a")
    await rig.service.start_node("a")
    assert await rig.pid("a")


async def test_a_row_that_is_to_run_again_is_the_later_word(rig: Rig) -> None:
    await rig.table(row("a"))
    await rig.service.stop_node("a")
    await rig.table(row("a", run=False))
    assert rig.node("a")["state"] == "stopped"
    await rig.table(row("a", run=True))
    assert await rig.pid("a")
    await rig.again()
    assert await rig.pid("a")


async def test_restart_gives_another_process(rig: Rig) -> None:
    await rig.table(row("a"))
    first = await rig.pid("a")
    await rig.service.restart_node("a")
    assert await rig.pid("a") != first
    assert not psutil.pid_exists(first)


async def test_whoever_asks_for_a_restart_may_go_away_meanwhile(rig: Rig) -> None:
    await rig.table(row("a", DEAF, stop_grace_s=0.5))
    await rig.up("a")
    first = await rig.pid("a")
    asking = asyncio.create_task(rig.service.do(rig.service.restart_node("a")))
    await asyncio.sleep(0)
    asking.cancel()
    await asyncio.gather(asking, return_exceptions=True)
    await wait_until_async(lambda: rig.node("a")["pid"] not in (None, first))


async def test_stop_and_start_at_once_never_run_it_twice(rig: Rig) -> None:
    await rig.table(row("a", DEAF, stop_grace_s=0.3))
    for _ in range(3):
        await asyncio.gather(
            rig.service.stop_node("a"), rig.service.start_node("a"), rig.service.restart_node("a"), rig.table(row("a"))
        )

    def sleepers() -> list[psutil.Process]:
        children = psutil.Process().children(recursive=True)
        return [child for child in children if "sigwait" in " ".join(child.cmdline())]

    await wait_until_async(sleepers)  # a process has no command line while it becomes another program
    assert len(sleepers()) == 1


STOP = "import os, sys; print(os.environ['METAROS_NODE'], os.environ['X'], file=open(sys.argv[1], 'a'))"
DYING = {"critical": True, "window_exits": 1, "base_delay_s": 0.01, "max_delay_s": 0.02, "env": {"X": "1"}}


async def test_a_critical_node_that_keeps_dying_brings_the_robot_to_rest(rig: Rig) -> None:
    path = rig.directory / "rest"
    stop = [sys.executable, "-S", "-c", STOP, str(path)]
    await rig.table(
        row("a", "raise SystemExit(1)", safe_stop=stop, **DYING),
        row("b", "raise SystemExit(78)", safe_stop=stop, **DYING),  # it is not started again
        row("c", "raise SystemExit(1)", **DYING),
        row("d", "raise SystemExit(1)", safe_stop=[sys.executable, "-c", "raise SystemExit('no brake')"], **DYING),
        row("e", "raise SystemExit(78)", safe_stop=stop, env={"X": "1"}),
        row("f", "", safe_stop=stop, restart="never", **DYING),  # it has done what it had to do
    )
    ends = {"a": "done", "b": "done", "c": "wanted, and the robot's settings name none", "d": "failed: no brake"}
    for name, end in ends.items():  # each comes again, as these nodes go on dying
        await wait_until_async(lambda name=name, end=end: rig.node(name)["safe_stop"] == end)
    assert set(path.read_text().splitlines()) == {"a 1", "b 1"}
    await rig.until("e", "ended")
    await rig.until("f", "ended")
    assert rig.node("e")["safe_stop"] == rig.node("f")["safe_stop"] == ""


async def test_a_crash_loop_is_quarantined_seen_and_reported(rig: Rig) -> None:
    code = "import sys; print('starting', flush=True); sys.exit('no lidar on /dev/ttyUSB0')"
    await rig.table(
        row("a", code, window_exits=2, base_delay_s=0.01, max_delay_s=0.02, env={"ROS_X": "1", "ROS_KEY": "s"})
    )
    await rig.until("a", "quarantined")
    reports = rig.service.crashes("a")
    assert len(reports) == 3
    assert reports[-1]["reason"] == "exit code 1: no lidar on /dev/ttyUSB0"
    assert reports[-1]["lines"] == ["starting", "no lidar on /dev/ttyUSB0"]
    assert reports[-1]["env"]["ROS_X"] == "1"
    assert "ROS_KEY" not in reports[-1]["env"]
    await rig.again()
    assert len(rig.service.crashes("a")) >= 3


async def test_retry_ends_a_quarantine(rig: Rig, tmp_path: Path) -> None:
    code = f"import os, sys; os.path.exists({str(tmp_path / 'cured')!r}) or sys.exit(1)\n{SLEEP}"
    await rig.table(row("a", code, window_exits=1, base_delay_s=0.01))
    await rig.until("a", "quarantined")
    (tmp_path / "cured").touch()
    await rig.service.retry_node("a")
    await rig.until("a", "running")


async def test_a_finished_node_runs_again_when_started(rig: Rig) -> None:
    await rig.table(row("a", "print('up')", restart="never"))
    await rig.until("a", "ended")
    await rig.service.start_node("a")
    await wait_until_async(lambda: rig.service.log_path("a").read_bytes().count(b" up\n") == 2)


async def test_a_signal_reaches_it(rig: Rig) -> None:
    await rig.table(row("a", restart="never"))
    await rig.up("a")
    rig.service.signal_node("a", signal.SIGTERM)
    await rig.until("a", "ended")
    assert rig.node("a")["last_exit"] == "killed by SIGTERM"
    with pytest.raises(UnavailableError, match="does not run"):
        rig.service.signal_node("a", signal.SIGTERM)


async def test_nobody_by_that_name(rig: Rig) -> None:
    with pytest.raises(UnavailableError, match="no node 'x'"):
        await rig.service.restart_node("x")


# -- leases ------------------------------------------------------------------------------------------------------------


def lease(rig: Rig, valid_s: float, *, node: str = "m", age_s: float = 0.0, lease_id: str = "one") -> None:
    rig.service.set_leases([(node, lease_id, valid_s)], age_s=age_s)


async def test_a_migratable_node_runs_under_a_lease_alone(rig: Rig) -> None:
    await rig.table(row("m", migratable=True), row("a"))
    assert rig.node("m")["why"] == "no lease"
    lease(rig, 60.0)
    await rig.until("m", "running")
    assert rig.node("m")["lease_id"] == "one"
    rig.service.set_leases([], age_s=0.0)
    await rig.until("m", "stopped")
    assert rig.node("a")["state"] == "running"


@pytest.mark.parametrize("code", [SLEEP, DEAF])
async def test_without_a_renewal_it_is_dead_before_the_end(rig: Rig, code: str) -> None:
    """Seen by the lease's own clock, which the test moves: nobody renews, nobody asks."""
    await rig.table(row("m", code, migratable=True, stop_grace_s=0.2))
    lease(rig, 3600.0)
    await rig.up("m")
    pid = await rig.pid("m")
    rig.ahead_s = 3599.0
    await wait_until_async(lambda: not psutil.pid_exists(pid))
    await rig.until("m", "stopped")
    assert rig.node("m")["why"] == "no lease"


async def test_a_suspended_machine_wakes_up_after_the_end(rig: Rig) -> None:
    await rig.table(row("m", DEAF, migratable=True, stop_grace_s=600.0))
    lease(rig, 3600.0)
    await rig.up("m")
    pid = await rig.pid("m")
    rig.ahead_s = 1e6
    await wait_until_async(lambda: not psutil.pid_exists(pid))
    await rig.until("m", "stopped")


async def test_a_stopped_process_is_killed_at_the_end(rig: Rig) -> None:
    await rig.table(row("m", migratable=True, stop_grace_s=0.2))
    lease(rig, 3600.0)
    await rig.up("m")
    os.kill(await rig.pid("m"), signal.SIGSTOP)
    rig.ahead_s = 3599.5
    await rig.until("m", "stopped")
    assert rig.node("m")["pid"] is None


async def test_a_crash_without_a_lease_is_the_end(rig: Rig) -> None:
    await rig.table(row("m", migratable=True, stop_grace_s=60.0, base_delay_s=0.01))
    lease(rig, 3600.0)
    await rig.up("m")
    rig.ahead_s = 3599.99
    os.kill(await rig.pid("m"), signal.SIGKILL)
    await rig.until("m", "stopped")


async def test_a_renewal_keeps_its_process(rig: Rig) -> None:
    await rig.table(row("m", migratable=True))
    lease(rig, 3600.0)
    await rig.until("m", "running")
    pid = await rig.pid("m")
    for ahead_s in (1000.0, 2000.0, 3000.0, 4000.0):
        rig.ahead_s = ahead_s
        lease(rig, 3600.0)
    assert await rig.pid("m") == pid


async def test_nothing_of_leases_outlives_the_supervisor(rig: Rig) -> None:
    await rig.table(row("m", migratable=True))
    lease(rig, 3600.0)
    await rig.until("m", "running")
    await rig.again()
    assert rig.node("m")["why"] == "no lease"
    assert TableFile(rig.directory / "supervisor.json").table.rows[0].migratable
