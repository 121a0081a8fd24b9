"""The agent as a program: ready by its status file, clean end on a signal, one line for a wrong option."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from tests.support.ports import free_port
from tests.support.processes import END_S, started
from tests.support.waiting import wait_until

COMMAND = (
    "import typer; from edge_agent.cli import register; app = typer.Typer(); app.callback()(lambda: None); "
    "register(app); app()"
)


def start(*options: str) -> AbstractContextManager[subprocess.Popen[str]]:
    return started([sys.executable, "-c", COMMAND, "agent", *options])


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_is_ready_without_a_gateway_and_ends_cleanly(
    zenoh_router: str, tmp_path: Path, number: signal.Signals
) -> None:
    status = tmp_path / "agent.json"
    gateway, port = f"127.0.0.1:{free_port()}", zenoh_router.rpartition(":")[2]
    options = ("--name", "r1", "--gateway", gateway, "--zenoh-port", port)
    places = ("--status-file", str(status), "--state-dir", str(tmp_path / "state"))
    with start(*options, *places) as agent:
        wait_until(lambda: status.exists() or agent.poll() is not None, timeout_s=60)
        assert json.loads(status.read_text()) == {"pid": agent.pid, "ready": True, "name": "r1", "namespace": "/"}
        agent.send_signal(number)
        _, errors = agent.communicate(timeout=END_S)
        assert agent.returncode == 0, errors
        assert "Traceback" not in errors
        assert not status.exists()


def test_a_wrong_option_is_one_line() -> None:
    with start("--gateway", "nowhere") as agent:
        _, errors = agent.communicate(timeout=END_S)
    assert agent.returncode == 2
    assert errors.startswith("metaros agent: command line: gateway must be HOST:PORT")
    assert errors.strip().endswith("not 'nowhere'")
    assert len(errors.strip().splitlines()) == 1
