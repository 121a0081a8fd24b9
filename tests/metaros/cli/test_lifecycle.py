"""`metaros lifecycle` against a lifecycle node on a real router."""

from __future__ import annotations

import json
from collections.abc import Iterator

import pytest

import metaros
from tests.metaros.cli.conftest import Reported, Run, spinning
from tests.support.processes.command_line import program
from tests.support.processes.processes import END_S, started


@pytest.fixture(autouse=True, scope="module")
def leg(zenoh_router: str, told: Reported) -> Iterator[metaros.LifecycleNode]:
    """A lifecycle node, one that refuses to be cleaned up, a hidden one, and one without a lifecycle."""
    with (
        metaros.Context(connect=zenoh_router) as context,
        metaros.LifecycleNode("arm", namespace="/demo", context=context) as arm,
        metaros.LifecycleNode("leg", namespace="/demo", context=context) as leg,
        metaros.LifecycleNode("_hidden", context=context) as hidden,
        metaros.Node("plain", context=context) as plain,
    ):
        leg.on_cleanup(lambda: False)
        with spinning(arm, leg, hidden, plain):
            for node in (arm, leg, hidden):
                told(f"{node.full_name}/get_transition_graph")
            yield leg


def test_nodes(run: Run) -> None:
    assert run("lifecycle", "nodes").out == "/demo/arm\n/demo/leg\n"
    assert run("lifecycle", "nodes", "-a").out == "/_hidden\n/demo/arm\n/demo/leg\n"
    assert run("lifecycle", "nodes", "-a", "--count-nodes").out == "3\n"
    assert json.loads(run("lifecycle", "nodes", "-o", "json").out) == ["/demo/arm", "/demo/leg"]


def test_get(run: Run) -> None:
    assert run("lifecycle", "get", "/demo/arm").out == "unconfigured [1]\n"
    assert "/demo/arm: unconfigured [1]" in run("lifecycle", "get").out.splitlines()
    answer = json.loads(run("lifecycle", "get", "demo/arm", "-o", "json").out)
    assert answer == {"node": "/demo/arm", "id": 1, "label": "unconfigured"}


def test_list(run: Run) -> None:
    assert run("lifecycle", "list", "/demo/arm").out == (
        "- configure [1]\n\tStart: unconfigured\n\tGoal: configuring\n"
        "- shutdown [5]\n\tStart: unconfigured\n\tGoal: shuttingdown\n"
    )
    rows = json.loads(run("lifecycle", "list", "/demo/arm", "--all", "-o", "json").out)
    assert len(rows) == 25
    assert rows[0] == {"id": 1, "label": "configure", "start": "unconfigured", "goal": "configuring"}


def test_set(run: Run, leg: metaros.LifecycleNode) -> None:
    assert run("lifecycle", "set", "/demo/leg", "configure").out == "Transitioning successful\n"
    assert leg.state.label == "inactive"
    done = run("lifecycle", "set", "/demo/leg", "cleanup", "-o", "json")
    assert json.loads(done.out) == {"node": "/demo/leg", "success": False, "id": 2, "label": "inactive"}
    assert (done.code, done.err) == (1, "error: Transitioning failed: /demo/leg is inactive\n")
    assert run("lifecycle", "set", "/demo/leg", "3").code == 0
    assert leg.state.label == "active"


def test_a_transition_that_is_not_possible_is_reported_those_that_are(run: Run) -> None:
    done = run("lifecycle", "set", "/demo/arm", "activate")
    assert done.code == 2
    assert "unknown transition 'activate', available ones are:\n- configure [1]\n- shutdown [5]" in done.err


def test_nodes_that_are_not_there(run: Run) -> None:
    done = run("lifecycle", "get", "/demo/arms")
    assert done.code == 1
    assert "did you mean /demo/arm?" in done.err
    done = run("lifecycle", "list", "/plain")
    assert done.code == 1
    assert "/plain has no lifecycle" in done.err


def test_as_a_process(zenoh_port: str) -> None:
    with started(program("lifecycle", "get", "/demo/arm", "--zenoh-port", zenoh_port)) as process:
        assert process.communicate(timeout=END_S) == ("unconfigured [1]\n", "")
    assert process.returncode == 0
