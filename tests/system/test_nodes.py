"""A robot's nodes keep their processes, whatever becomes of agent, link and gateway."""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import psutil
import pytest

from metaros.errors import UnavailableError
from metaros.supervise.client import ask
from metaros.supervise.program import running_pid
from metaros.supervise.table_file import TableFile, read_rows
from tests.support.stack import Program, Stack
from tests.support.waiting import wait_until

pytestmark = [
    pytest.mark.integration,
    pytest.mark.skipif(sys.platform == "win32", reason="kills as POSIX does"),
]
SLEEP = "import signal; print('up', flush=True); signal.sigwait([signal.SIGINT])"
NODES = ("a", "b")
SILENT_S = 3.0  # the 60 s without a packet are in test_node_survival.py


@pytest.fixture
def stack(tmp_path: Path) -> Iterator[Stack]:
    with Stack(tmp_path) as stack:
        try:
            yield stack
        finally:
            if running_pid(state_of(stack)) is not None:
                ask(state_of(stack), "shutdown")  # so that the agent, which still lives, starts none
                wait_until(lambda: running_pid(state_of(stack)) is None)


def state_of(stack: Stack) -> Path:
    return stack.folder / "robot"


def pids(stack: Stack) -> dict[str, int]:
    try:
        found = ask(state_of(stack), "list")["nodes"]
    except UnavailableError:  # it is just starting
        return {}
    return {node["name"]: node["pid"] for node in found if node["state"] == "running"}


def robot(stack: Stack) -> Program:
    """An agent whose supervisor has a table; it starts the supervisor."""
    state_of(stack).mkdir(mode=0o700, exist_ok=True)
    if not (state_of(stack) / "supervisor.json").exists():
        rows = [{"name": name, "argv": [sys.executable, "-S", "-c", SLEEP]} for name in NODES]
        TableFile(state_of(stack) / "supervisor.json").replace(read_rows(rows), frozenset(), tag="")
    agent = stack.agent("r1", "--state-dir", str(state_of(stack)))
    wait_until(lambda: running_pid(state_of(stack)) and (state_of(stack) / "supervisor.sock").exists())
    wait_until(lambda: set(pids(stack)) == set(NODES))
    wait_until(lambda: "r1" in stack.online())
    return agent


def test_pids_survive_agent_gateway_and_link(stack: Stack) -> None:
    stack.router()
    gateway = stack.gateway()
    agent = robot(stack)
    before, supervisor = pids(stack), running_pid(state_of(stack))
    agent.kill()
    agent = stack.restart(agent)
    wait_until(lambda: "r1" in stack.online())
    assert pids(stack) == before
    gateway.process.send_signal(signal.SIGSTOP)  # the link is there and says nothing
    healed_s = time.monotonic() + SILENT_S
    wait_until(lambda: time.monotonic() > healed_s, timeout_s=20 * SILENT_S, every_s=0.2)
    gateway.process.send_signal(signal.SIGCONT)
    gateway.kill()
    stack.restart(gateway)
    wait_until(lambda: "r1" in stack.online())
    assert pids(stack) == before
    assert running_pid(state_of(stack)) == supervisor


@pytest.mark.skipif(sys.platform != "linux", reason="the parent-death signal is Linux's")
def test_killing_the_supervisor_kills_all_and_the_agent_brings_them_back(stack: Stack) -> None:
    stack.router()
    stack.gateway()
    robot(stack)
    before, supervisor = pids(stack), running_pid(state_of(stack))
    assert supervisor is not None
    os.kill(supervisor, signal.SIGKILL)
    wait_until(lambda: not any(psutil.pid_exists(pid) for pid in before.values()))
    wait_until(lambda: running_pid(state_of(stack)) not in (None, supervisor))
    wait_until(lambda: set(pids(stack)) == set(NODES))
