"""`metaros doctor` names the hop that fails, and the fix."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from typing import Any

from tests.metaros.cli.conftest import Run


def doctor(*arguments: str) -> tuple[int, dict[str, dict[str, Any]]]:
    """Exit code and checks by name."""
    command = [sys.executable, "-m", "metaros", "doctor", "-o", "json", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    return done.returncode, {check["check"]: check for check in json.loads(done.stdout)["checks"]}


def test_with_a_router_all_is_well_and_the_canary_sings(run: Run) -> None:
    done = run("doctor", "-o", "json")
    answer = json.loads(done.stdout)
    checks = {check["check"]: check for check in answer["checks"]}
    assert (done.returncode, answer["ok"]) == (0, True)
    assert checks["Router"]["state"] == "ok"
    assert "publish to subscribe" in checks["Canary"]["text"]


def test_for_people_it_ends_with_a_verdict(run: Run) -> None:
    done = run("doctor")
    assert done.returncode == 0
    assert "All is well" in done.stdout.splitlines()[-1]


def test_no_router(free_port: int) -> None:
    code, checks = doctor("--zenoh-port", str(free_port))
    assert code == 1
    assert checks["Router"]["state"] == "failed"
    assert "metaros up" in checks["Router"]["fix"]
    assert "Graph" not in checks


def test_a_foreign_program_on_the_port() -> None:
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        listener.listen(8)
        code, checks = doctor("--zenoh-port", str(listener.getsockname()[1]))
    assert code == 1
    assert "is no Zenoh router" in checks["Router"]["text"]


def test_a_gateway_that_does_not_answer(free_port: int, zenoh_router: str) -> None:
    code, checks = doctor("--port", str(free_port), "--zenoh-port", zenoh_router.rsplit(":", 1)[1])
    assert code == 1
    assert "nobody answers" in checks["Gateway"]["text"]
