"""`metaros doctor` names the hop that fails, and the fix."""

from __future__ import annotations

import json
from typing import Any

from tests.metaros.cli.conftest import Run
from tests.support.processes.command_line import call_metaros, program
from tests.support.processes.processes import END_S, started


def doctor(*arguments: str) -> tuple[int, dict[str, dict[str, Any]]]:
    """Exit code and checks by name."""
    return found(*call_metaros("doctor", "-o", "json", *arguments)[:2])


def found(code: int, out: str) -> tuple[int, dict[str, dict[str, Any]]]:
    """The same of what it printed."""
    return code, {check["check"]: check for check in json.loads(out)["checks"]}


def test_with_a_router_all_is_well_and_the_canary_sings(run: Run) -> None:
    done = run("doctor", "-o", "json")
    answer = json.loads(done.out)
    checks = {check["check"]: check for check in answer["checks"]}
    assert (done.code, answer["ok"]) == (0, True)
    assert checks["Router"]["state"] == "ok"
    assert "publish to subscribe" in checks["Canary"]["text"]


def test_for_people_it_ends_with_a_verdict(run: Run) -> None:
    done = run("doctor")
    assert done.code == 0
    assert "All is well" in done.out.splitlines()[-1]


def test_no_router(free_port: int) -> None:
    with started(program("doctor", "-o", "json", "--zenoh-port", str(free_port))) as process:
        out, _ = process.communicate(timeout=END_S)
    code, checks = found(process.returncode, out)
    assert code == 1
    assert checks["Router"]["state"] == "failed"
    assert "metaros up" in checks["Router"]["fix"]
    assert "Graph" not in checks


def test_a_foreign_program_on_the_port(foreign_port: int) -> None:
    code, checks = doctor("--zenoh-port", str(foreign_port))
    assert code == 1
    assert "is no Zenoh router" in checks["Router"]["text"]


def test_a_gateway_that_does_not_answer(free_port: int, zenoh_port: str) -> None:
    code, checks = doctor("--port", str(free_port), "--zenoh-port", zenoh_port)
    assert code == 1
    assert "nobody answers" in checks["Gateway"]["text"]
