"""Whoever kills the supervisor kills what its nodes have started, too."""

from __future__ import annotations

import asyncio
import os
import signal
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from metaros.supervise.node_table_file import TableFile, read_rows
from metaros.supervise.orphan_reaper import OrphanReaper
from tests.support.processes.processes import started
from tests.support.waiting import wait_until, wait_until_async

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="there are no process groups")

SLEEP = [sys.executable, "-S", "-c", "import time; time.sleep(3600)"]
PARENT = f"import subprocess, time; subprocess.Popen({SLEEP!r}); time.sleep(3600)"
NODES = {"plain": SLEEP, "parent": [sys.executable, "-S", "-c", PARENT]}


def alive(pid: int) -> bool:
    try:
        return bool(psutil.Process(pid).status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def test_a_killed_supervisor_takes_the_children_of_its_nodes_along(tmp_path: Path) -> None:
    rows = [{"name": name, "argv": argv} for name, argv in NODES.items()]
    TableFile(tmp_path / "supervisor.json").replace(read_rows(rows), frozenset(), tag="")
    argv = [sys.executable, "-m", "metaros", "supervisor", "--detached", "--state-dir", str(tmp_path)]
    with started(argv) as process:
        found = psutil.Process(process.pid)
        wait_until(lambda: len(found.children(recursive=True)) == 4)  # two nodes, the child of one, the warden
        nodes = [child.pid for child in found.children(recursive=True)]
        process.send_signal(signal.SIGKILL)
        wait_until(lambda: not any(alive(pid) for pid in nodes))


async def test_who_died_is_replaced_and_knows_all(tmp_path: Path) -> None:
    reaper, mark = OrphanReaper(), tmp_path / "last"
    group, gone = [await asyncio.to_thread(subprocess.Popen, SLEEP, process_group=0) for _ in range(2)]
    try:
        reaper.group_started(group.pid, ["touch", str(mark)])
        reaper.group_started(gone.pid)
        first = reaper.pid
        assert first is not None
        os.kill(first, signal.SIGKILL)
        await wait_until_async(lambda: reaper.pid not in (None, first))
        reaper.group_ended(gone.pid)
        popen = reaper._popen
        assert popen is not None
        assert popen.stdin is not None
        popen.stdin.close()  # as the kernel does when we are killed
        assert group.wait(60) == -signal.SIGKILL
        popen.wait(60)
        assert mark.exists()
        assert gone.poll() is None  # its number may be another's by now
    finally:
        reaper.close()
        for popen in (group, gone):
            popen.kill()
            popen.wait()


def is_deaf(pid: int) -> bool:
    """Whether it has come to ignore SIGINT."""
    status = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return bool(int(status["SigIgn"], 16) >> (signal.SIGINT - 1) & 1)


async def test_in_good_order_it_does_nothing_and_is_gone(tmp_path: Path) -> None:
    reaper = OrphanReaper()
    reaper.group_started(2**22 + 1)
    pid = reaper.pid
    assert pid is not None
    if sys.platform == "linux":
        await wait_until_async(lambda: is_deaf(pid))
        os.kill(pid, signal.SIGINT)  # a terminal's Ctrl-C is not for it
    reaper.group_ended(2**22 + 1)
    assert alive(pid)
    reaper.close()
    assert not alive(pid)
    assert reaper.pid is None
