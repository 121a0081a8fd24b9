"""The agent as a program: ready by its status file, clean end on a signal, one line for a wrong option."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.support.ports import free_port
from tests.support.waiting import wait_until

COMMAND = (
    "import typer; from edge_agent.cli import register; app = typer.Typer(); app.callback()(lambda: None); "
    "register(app); app()"
)


def start(*options: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND, "agent", *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_it_is_ready_without_a_gateway_and_ends_cleanly(
    zenoh_router: str, tmp_path: Path, number: signal.Signals
) -> None:
    status = tmp_path / "agent.json"
    gateway, port = f"127.0.0.1:{free_port()}", zenoh_router.rpartition(":")[2]
    places = ("--status-file", str(status), "--state-dir", str(tmp_path / "state"))
    agent = start("--name", "r1", "--gateway", gateway, "--zenoh-port", port, *places)
    try:
        wait_until(lambda: status.exists() or agent.poll() is not None, timeout_s=20)
        assert json.loads(status.read_text()) == {"pid": agent.pid, "ready": True, "name": "r1", "namespace": "/"}
        agent.send_signal(number)
        started = time.monotonic()
        _, errors = agent.communicate(timeout=10)
        assert agent.returncode == 0, errors
        assert time.monotonic() - started < 3.0
        assert "Traceback" not in errors
        assert not status.exists()
    finally:
        agent.kill()
        agent.communicate()


def test_a_wrong_option_is_one_line() -> None:
    agent = start("--gateway", "nowhere")
    _, errors = agent.communicate(timeout=20)
    assert agent.returncode == 2
    assert errors.startswith("metaros agent: command line: gateway must be HOST:PORT")
    assert errors.strip().endswith("not 'nowhere'")
    assert len(errors.strip().splitlines()) == 1
