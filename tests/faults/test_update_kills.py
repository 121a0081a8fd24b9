"""An agent killed at every step of an update, by SIGKILL: what starts next is whole, and the update can be made."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import pytest

from edge_agent.update.slots import Slots, python_of
from metaros.clock import SystemClock
from tests.support.processes.processes import END_S, started
from tests.support.robots.tuf_robot import OLD, fill_slot
from tests.support.servers.tuf_repository import Served, TufRepository, make_bundle, make_wheel, serve, utc
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.integration, pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")]

STEPS = ("downloading", "verified", "emptied", "unpacked", "installed", "sealed", "switched")
PROGRAM = """
import os, random, ssl, sys, traceback
from pathlib import Path
from edge_agent.update.restart import LoaderInfo
from edge_agent.update.slots import Slots
from edge_agent.update.source import Source
from edge_agent.update.updater import AgentUpdates
from metaros.clock import SystemClock
state, url = Path(sys.argv[1]), sys.argv[2]
def update(kill_at):
    source = Source(state / "update", url, ssl.create_default_context, SystemClock())
    source.folder.mkdir(parents=True, exist_ok=True)
    loaded = LoaderInfo(loader=("x",))
    updates = AgentUpdates(
        Slots(state), source, SystemClock(), random.Random(1), loader_info=loaded, running="2.0.0", restart=print
    )
    def step(name):
        if name == kill_at:
            os.kill(os.getpid(), 9)
    updates.install("2.1.0", step)
for line in sys.stdin:
    pid = os.fork()
    if pid == 0:
        try:
            update(line.strip())
        except BaseException:
            traceback.print_exc()
        os._exit(1)
    print(pid, flush=True)
    print(os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]), flush=True)
"""
MODULE = {"metaros_kill_test.py": "VERSION = '2.1.0'"}


@pytest.fixture
def repository() -> TufRepository:
    found = TufRepository(utc(SystemClock().wall_ns()))
    found.add("agents/metaros/2.1.0.zip", make_bundle("2.1.0", wheels=dict([make_wheel("kill_test", "2.1.0", MODULE)])))
    found.publish()
    return found


class Agents:
    """Updates, each in a process of its own, forked off one that has imported everything."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process

    def begin(self, kill_at: str = "") -> int:
        """Update; the process's id."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{kill_at}\n")
        self._process.stdin.flush()
        return self._said()

    def ended(self) -> int:
        """Its exit code, once it has ended."""
        return self._said()

    def _said(self) -> int:
        assert self._process.stdout is not None
        return int(self._process.stdout.readline())


@contextmanager
def agents(state: Path, served: Served) -> Iterator[Agents]:
    """Until the block ends."""
    command = [sys.executable, "-c", PROGRAM, str(state), served.url]
    with started(command, stdin=subprocess.PIPE, stderr=None) as process:
        yield Agents(process)


def old_runs(state: Path) -> Slots:
    """2.0.0 was kept."""
    slots = Slots(state)
    slots.switch(fill_slot(slots, "a", OLD), OLD)
    slots.mark_good()
    return slots


def killed(agents: Agents, step: str) -> None:
    """An update that ends there."""
    agents.begin(step)
    assert agents.ended() == -signal.SIGKILL, step


def kill(agents: Agents, pid: int) -> None:
    """From outside, while it runs."""
    os.kill(pid, signal.SIGKILL)
    assert agents.ended() == -signal.SIGKILL


def check_whole(slots: Slots, version: str) -> None:
    """That version is what starts next, and all of it is there."""
    current = slots.boot(most=100)
    assert current.version == version
    assert slots.complete(current.slot, current.version)


def test_killed_at_every_step_and_made_in_the_end(tmp_path: Path, repository: TufRepository) -> None:
    """Each try finds what the one before has left; the last one is whole."""
    slots, half = old_runs(tmp_path), threading.Event()

    def stall(handler: BaseHTTPRequestHandler, data: bytes) -> None:
        handler.send_response(200)
        handler.send_header("Content-Length", str(len(data)))
        handler.end_headers()
        handler.wfile.write(data[:300])
        handler.wfile.flush()
        half.set()
        served.ending.wait()

    with serve(repository) as served, agents(tmp_path, served) as robot:
        served.misbehave(".zip", stall)
        pid = robot.begin()
        assert half.wait(END_S)
        wait_until(lambda: sum(path.stat().st_size for path in tmp_path.glob("update/parts/*")) == 300)
        kill(robot, pid)  # in the middle of the download
        served.faults.clear()
        check_whole(slots, OLD)
        for step in STEPS[: STEPS.index("unpacked") + 1]:
            killed(robot, step)
            check_whole(slots, OLD)
            if step == "verified":  # what came is not fetched again
                assert [span for path, span in served.asked if path.endswith(".zip")] == ["", "bytes=300-"]
        pid = robot.begin()
        wait_until(python_of(slots.path("b")).exists)
        kill(robot, pid)  # while pip runs
        check_whole(slots, OLD)
        for step in STEPS[STEPS.index("unpacked") + 1 : -1]:
            killed(robot, step)
            check_whole(slots, OLD)
        killed(robot, STEPS[-1])
    current = slots.boot(most=100)
    assert (current.version, current.previous_version, current.probing) == ("2.1.0", OLD, True)
    check_whole(slots, "2.1.0")
    code = "import metaros_kill_test, metaros, json; print(json.dumps(metaros_kill_test.VERSION))"
    python = python_of(slots.path(current.slot))
    assert json.loads(subprocess.run([python, "-I", "-c", code], capture_output=True, check=True).stdout) == "2.1.0"
