"""`metaros lifecycle` against a lifecycle node on a real router."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator

import pytest

import metaros
from tests.metaros.cli.conftest import Run


@pytest.fixture(autouse=True)
def arm(zenoh_router: str) -> Iterator[metaros.LifecycleNode]:
    """A lifecycle node that refuses to be cleaned up, a hidden one, and one without a lifecycle."""
    with (
        metaros.Context(connect=zenoh_router) as context,
        metaros.LifecycleNode("arm", namespace="/demo", context=context) as node,
        metaros.LifecycleNode("_hidden", context=context) as hidden,
        metaros.Node("plain", context=context) as plain,
    ):
        node.on_cleanup(lambda: False)
        executor = metaros.SingleThreadedExecutor()
        for each in (node, hidden, plain):
            executor.add_node(each)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield node
        executor.shutdown()
        thread.join()


def test_nodes(run: Run) -> None:
    assert run("lifecycle", "nodes").stdout == "/demo/arm\n"
    assert run("lifecycle", "nodes", "-a").stdout == "/_hidden\n/demo/arm\n"
    assert run("lifecycle", "nodes", "-a", "--count-nodes").stdout == "2\n"
    assert json.loads(run("lifecycle", "nodes", "-o", "json").stdout) == ["/demo/arm"]


def test_get(run: Run) -> None:
    assert run("lifecycle", "get", "/demo/arm").stdout == "unconfigured [1]\n"
    assert "/demo/arm: unconfigured [1]" in run("lifecycle", "get").stdout.splitlines()
    answer = json.loads(run("lifecycle", "get", "demo/arm", "-o", "json").stdout)
    assert answer == {"node": "/demo/arm", "id": 1, "label": "unconfigured"}


def test_list(run: Run) -> None:
    assert run("lifecycle", "list", "/demo/arm").stdout == (
        "- configure [1]\n\tStart: unconfigured\n\tGoal: configuring\n"
        "- shutdown [5]\n\tStart: unconfigured\n\tGoal: shuttingdown\n"
    )
    rows = json.loads(run("lifecycle", "list", "/demo/arm", "--all", "-o", "json").stdout)
    assert len(rows) == 25
    assert rows[0] == {"id": 1, "label": "configure", "start": "unconfigured", "goal": "configuring"}


def test_set(run: Run, arm: metaros.LifecycleNode) -> None:
    assert run("lifecycle", "set", "/demo/arm", "configure").stdout == "Transitioning successful\n"
    assert arm.state.label == "inactive"
    done = run("lifecycle", "set", "/demo/arm", "cleanup", "-o", "json")
    assert json.loads(done.stdout) == {"node": "/demo/arm", "success": False, "id": 2, "label": "inactive"}
    assert (done.returncode, done.stderr) == (1, "error: Transitioning failed: /demo/arm is inactive\n")
    assert run("lifecycle", "set", "/demo/arm", "3").returncode == 0
    assert arm.state.label == "active"


def test_a_transition_that_is_not_possible_is_told_those_that_are(run: Run) -> None:
    done = run("lifecycle", "set", "/demo/arm", "activate")
    assert done.returncode == 2
    assert "unknown transition 'activate', available ones are:\n- configure [1]\n- shutdown [5]" in done.stderr


def test_nodes_that_are_not_there(run: Run) -> None:
    done = run("lifecycle", "get", "/demo/arms", "--spin-time", "0.5")
    assert done.returncode == 1
    assert "did you mean /demo/arm?" in done.stderr
    done = run("lifecycle", "list", "/plain")
    assert done.returncode == 1
    assert "/plain has no lifecycle" in done.stderr
