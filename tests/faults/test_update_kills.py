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


def killed(state: Path, served: Served, step: str) -> None:
    """An update that ends there."""
    with started(program(state, served, step)) as process:
        assert process.wait(END_S) == -9, step


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

    with serve(repository) as served:
        served.misbehave(".zip", stall)
        with started(program(tmp_path, served)) as process:  # in the middle of the download
            assert half.wait(END_S)
            wait_until(lambda: sum(path.stat().st_size for path in tmp_path.glob("update/parts/*")) == 300)
            process.kill()
            process.wait(END_S)
        served.faults.clear()
        check_whole(slots, OLD)
        for step in STEPS[: STEPS.index("unpacked") + 1]:
            killed(tmp_path, served, step)
            check_whole(slots, OLD)
            if step == "verified":  # what came is not fetched again
                assert [span for path, span in served.asked if path.endswith(".zip")] == ["", "bytes=300-"]
        with started(program(tmp_path, served)) as process:  # while pip runs
            python = python_of(slots.path("b"))
            wait_until(lambda: python.exists() and process.poll() is None)
            process.kill()
            process.wait(END_S)
        check_whole(slots, OLD)
        for step in STEPS[STEPS.index("unpacked") + 1 : -1]:
            killed(tmp_path, served, step)
            check_whole(slots, OLD)
        killed(tmp_path, served, STEPS[-1])
    current = slots.boot(most=100)
    assert (current.version, current.previous_version, current.probing) == ("2.1.0", OLD, True)
    check_whole(slots, "2.1.0")
    code = "import metaros_kill_test, metaros, json; print(json.dumps(metaros_kill_test.VERSION))"
    python = python_of(slots.path(current.slot))
    assert json.loads(subprocess.run([python, "-I", "-c", code], capture_output=True, check=True).stdout) == "2.1.0"
