"""An agent killed at every step of an update, by SIGKILL: what starts next is whole, and the update can be made."""

from __future__ import annotations

import json
import subprocess
import sys
import threading
from http.server import BaseHTTPRequestHandler
from pathlib import Path

import pytest

from edge_agent.update.slots import Slots, python_of
from metaros.clock import SystemClock
from tests.support.processes import END_S, started
from tests.support.tuf_repository import Served, TufRepository, make_bundle, make_wheel, serve, utc
from tests.support.tuf_robot import OLD, fill_slot
from tests.support.waiting import wait_until

pytestmark = [pytest.mark.integration, pytest.mark.skipif(sys.platform == "win32", reason="SIGKILL")]

STEPS = ("downloading", "verified", "emptied", "unpacked", "installed", "sealed", "switched")
PROGRAM = """
import os, random, ssl, sys
from pathlib import Path
from edge_agent.update.handover import Loaded
from edge_agent.update.slots import Slots
from edge_agent.update.source import Source
from edge_agent.update.updater import AgentUpdates
from metaros.clock import SystemClock
state, url, kill_at = Path(sys.argv[1]), sys.argv[2], sys.argv[3]
source = Source(state / "update", url, ssl.create_default_context, SystemClock())
source.folder.mkdir(parents=True, exist_ok=True)
updates = AgentUpdates(
    Slots(state), source, SystemClock(), random.Random(1), loaded=Loaded(loader=("x",)), running="2.0.0", restart=print
)
def step(name):
    if name == kill_at:
        os.kill(os.getpid(), 9)
updates.install("2.1.0", step)
"""
MODULE = {"metaros_kill_test.py": "VERSION = '2.1.0'"}


@pytest.fixture
def repository() -> TufRepository:
    found = TufRepository(utc(SystemClock().wall_ns()))
    found.add("agents/metaros/2.1.0.zip", make_bundle("2.1.0", wheels=dict([make_wheel("kill_test", "2.1.0", MODULE)])))
    found.publish()
    return found


def program(state: Path, served: Served, kill_at: str = "") -> list[str]:
    return [sys.executable, "-c", PROGRAM, str(state), served.url, kill_at]


def old_runs(state: Path) -> Slots:
    """2.0.0 was kept."""
    slots = Slots(state)
    slots.switch(fill_slot(slots, "a", OLD), OLD)
    slots.keep()
    return slots


def check_then_update(slots: Slots, state: Path, served: Served) -> None:
    """A whole version starts; and the update, made again, is whole, too."""
    current = slots.boot(most=3)
    assert slots.complete(current.slot, current.version)
    if current.version == OLD:
        done = subprocess.run(program(state, served), capture_output=True, text=True, timeout=END_S, check=False)
        assert done.returncode == 0, done.stderr
        current = slots.boot(most=3)
    assert (current.version, current.previous_version, current.probing) == ("2.1.0", OLD, True)
    code = "import metaros_kill_test, metaros, json; print(json.dumps(metaros_kill_test.VERSION))"
    python = python_of(slots.path(current.slot))
    assert json.loads(subprocess.run([python, "-I", "-c", code], capture_output=True, check=True).stdout) == "2.1.0"


@pytest.mark.parametrize("step", STEPS)
def test_killed_at_a_step(tmp_path: Path, repository: TufRepository, step: str) -> None:
    slots = old_runs(tmp_path)
    with serve(repository) as served:
        with started(program(tmp_path, served, step)) as process:
            assert process.wait(END_S) == -9
        assert slots.read().version == ("2.1.0" if step == "switched" else OLD)
        check_then_update(slots, tmp_path, served)


def test_killed_in_the_middle_of_the_download(tmp_path: Path, repository: TufRepository) -> None:
    """What came is not fetched again."""
    slots, half = old_runs(tmp_path), threading.Event()

    def stall(handler: BaseHTTPRequestHandler, data: bytes) -> None:
        handler.send_response(200)
        handler.send_header("Content-Length", str(len(data)))
        handler.end_headers()
        handler.wfile.write(data[:300])
        handler.wfile.flush()
        half.set()
        served.ending.wait()

    with serve(repository) as served:
        served.misbehave(".zip", stall)
        with started(program(tmp_path, served)) as process:
            assert half.wait(END_S)
            wait_until(lambda: sum(path.stat().st_size for path in tmp_path.glob("update/parts/*")) == 300)
            process.kill()
            process.wait(END_S)
        served.faults.clear()
        check_then_update(slots, tmp_path, served)
        assert [span for path, span in served.asked if path.endswith(".zip")] == ["", "bytes=300-"]


def test_killed_while_pip_runs(tmp_path: Path, repository: TufRepository) -> None:
    slots = old_runs(tmp_path)
    with serve(repository) as served:
        with started(program(tmp_path, served)) as process:
            wait_until(lambda: python_of(slots.path("b")).exists())
            process.kill()
            process.wait(END_S)
        assert slots.read().version == OLD
        check_then_update(slots, tmp_path, served)
