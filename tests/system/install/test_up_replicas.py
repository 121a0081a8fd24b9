"""`metaros up --replicas`: gateways on one PostgreSQL, a robot that goes to another one of them, and all of it ends.

That robots spread over them is in the plan: `tests/metaros/cli/up/test_launch_table.py`.
"""

from __future__ import annotations

import json
import signal
import urllib.request
from pathlib import Path

import psutil
import pytest

from tests.support.ports import free_port
from tests.support.processes.processes import END_S
from tests.support.servers.postgres import PostgresServer
from tests.support.waiting import wait_until
from tests.system.install.test_up import running


def online(url: str) -> dict[str, str]:
    """The robots that a gateway shows, and their state."""
    with urllib.request.urlopen(f"{url}/api/v1/robots", timeout=60) as answer:
        return {robot["id"]: robot["state"] for robot in json.load(answer)["robots"]}


@pytest.mark.integration
def test_a_fleet_goes_on_when_one_of_its_gateways_is_killed(
    tmp_path: Path, postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("METAROS_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.setenv("METAROS_STORE", postgres.schema())
    monkeypatch.setenv("HOME", str(tmp_path))
    ports = ("--port", str(free_port()), "--grpc-port", str(free_port()), "--zenoh-port", str(free_port()))
    where = ("--data-dir", str(tmp_path / "data"), *ports)
    with running(tmp_path, "--replicas", "2", "--robots", "1", "--no-host", *where) as up:
        (line,) = (line for line in up.text.splitlines() if line.strip().startswith("Replicas"))
        urls = [up.state_url, line.split()[1]]
        want = {"sim_1": "online"}
        for url in urls:
            wait_until(lambda url=url: online(url) == want)
        psutil.Process(up.pid_of("gateway")).kill()  # where the robot is
        wait_until(lambda: "gateway restarted" in up.text)
        for url in urls:
            wait_until(lambda url=url: answers(url) == want)
        up.children()
        up.process.send_signal(signal.SIGINT)
        assert up.process.wait(END_S) == 0
        wait_until(up.gone)


def answers(url: str) -> dict[str, str]:
    """The same while the gateway may be starting."""
    try:
        return online(url)
    except OSError:
        return {}
