"""`metaros action` against a real action server."""

from __future__ import annotations

import json
import signal
import threading
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

import metaros
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.node.action import ServerGoal
from tests.metaros.cli.conftest import Reported, Run, assert_reported, spinning
from tests.support.processes.command_line import program
from tests.support.processes.processes import END_S, started

HOLD, ABORT, REJECT = 100, 200, 300  # orders that mean something else


def execute(goal: ServerGoal) -> Any:
    """The numbers; or wait to be cancelled, or give up."""
    if goal.request.order == ABORT:
        goal.abort(Fibonacci.Result(sequence=[0]))
        return None
    if goal.request.order == HOLD:
        goal.publish_feedback(Fibonacci.Feedback(sequence=[7]))
        while not goal.is_cancel_requested:
            threading.Event().wait(0.01)
        goal.canceled(Fibonacci.Result(sequence=[7]))
        return None
    sequence = [0, 1]
    for _ in range(goal.request.order - 1):
        sequence.append(sequence[-1] + sequence[-2])
        goal.publish_feedback(Fibonacci.Feedback(sequence=sequence))
    return Fibonacci.Result(sequence=sequence)


@pytest.fixture(autouse=True, scope="module")
def server(zenoh_router: str, told: Reported) -> Iterator[metaros.Node]:
    """/math/counter serves /math/fibonacci."""
    with (
        metaros.Context(connect=zenoh_router) as context,
        metaros.Node("counter", namespace="/math", context=context) as node,
    ):
        node.create_action_server(Fibonacci, "fibonacci", execute, goal=lambda request: request.order != REJECT)
        with spinning(node):
            told("/math/fibonacci/_action/status")
            yield node


def test_list_type_find_info(run: Run, server: metaros.Node, told: Reported) -> None:
    assert run("action", "list").out == "/math/fibonacci\n"
    assert run("action", "list", "-t").out == "/math/fibonacci [example_interfaces/action/Fibonacci]\n"
    assert run("action", "list", "-c").out == "1\n"
    assert run("action", "type", "math/fibonacci").out == "example_interfaces/action/Fibonacci\n"
    assert run("action", "find", "example_interfaces/Fibonacci").out == "/math/fibonacci\n"
    with closing(server.create_action_client(Fibonacci, "/math/fibonacci")):
        told("/math/fibonacci/_action/status", ends=2)
        assert run("action", "info", "/math/fibonacci").out.splitlines() == [
            "Action: /math/fibonacci",
            "Type: example_interfaces/action/Fibonacci",
            "Action clients: 1",
            "    /math/counter",
            "Action servers: 1",
            "    /math/counter",
        ]
        facts = json.loads(run("action", "info", "/math/fibonacci", "-o", "json").out)
        assert facts["servers"] == ["/math/counter"]


def test_an_action_s_topics_and_services_are_hidden(run: Run) -> None:
    assert "_action" not in run("topic", "list").out + run("service", "list").out
    assert "/math/fibonacci/_action/feedback" in run("topic", "list", "--include-hidden-topics").out
    assert "action /math/fibonacci  example_interfaces/action/Fibonacci" in run("graph").out


def test_a_node_s_actions(run: Run) -> None:
    facts = json.loads(run("node", "info", "/math/counter", "-o", "json").out)
    assert facts["action_servers"] == [{"name": "/math/fibonacci", "type": "example_interfaces/action/Fibonacci"}]
    assert facts["action_clients"] == []
    assert "_action" not in run("node", "info", "/math/counter").out
    assert "/math/fibonacci/_action/send_goal" in run("node", "info", "/math/counter", "--include-hidden").out


def test_a_goal_from_sending_to_result(run: Run) -> None:
    done = run("action", "send_goal", "/math/fibonacci", "{order: 4}", "--feedback")
    assert done.code == 0, done.err
    assert "Sending goal:\n    order: 4\n" in done.out
    assert done.out.count("Feedback:") == 3
    assert done.out.endswith("Result:\n    sequence: [0, 1, 1, 2, 3]\n\nGoal finished with status: SUCCEEDED\n")


def test_a_goal_as_lines_of_json(run: Run) -> None:
    done = run(
        "action", "send_goal", "math/fibonacci", "example_interfaces/Fibonacci", "{order: 2}", "-f", "-o", "json"
    )
    first, *feedback, last = [json.loads(line) for line in done.out.splitlines()]
    assert first["accepted"]
    assert feedback == [{"feedback": {"sequence": [0, 1, 1]}}]
    assert last == {"status": "SUCCEEDED", "result": {"sequence": [0, 1, 1]}}


def test_errors_help(run: Run) -> None:
    table = {
        ("info", "/math/fibonaci"): (1, "did you mean /math/fibonacci?"),
        ("type", "/math/fibonaci"): (1, "did you mean /math/fibonacci?"),
        ("send_goal", "/math/fibonaci", "{order: 1}"): (1, "did you mean /math/fibonacci?"),
        ("send_goal", "/math/fibonacci", "{ordr: 1}"): (2, "order"),
        ("send_goal", "/math/fibonacci", "tf2_msgs/LookupTransform", "{}"): (2, "example_interfaces/action/Fibonacci"),
        ("send_goal", "/math/fibonacci", f"{{order: {REJECT}}}"): (1, "rejected"),
        ("find", "example_interfaces/Fibonaci"): (2, "example_interfaces/action/Fibonacci"),
    }
    assert_reported(run, table, "action")


def test_an_aborted_goal_is_exit_code_1(run: Run) -> None:
    done = run("action", "send_goal", "/math/fibonacci", f"{{order: {ABORT}}}")
    assert done.code == 1
    assert "Goal finished with status: ABORTED" in done.out


def test_ctrl_c_cancels_the_goal(zenoh_port: str) -> None:
    goal = ("action", "send_goal", "/math/fibonacci", f"{{order: {HOLD}}}", "-f")
    with started(program(*goal, "--zenoh-port", zenoh_port)) as sent:
        assert sent.stdout is not None
        for line in sent.stdout:
            if line == "Feedback:\n":
                break
        sent.send_signal(signal.SIGINT)
        out, err = sent.communicate(timeout=END_S)
    assert sent.returncode == 130
    assert "Goal finished with status: CANCELED" in out
    assert "cancelling" in err
    assert "Traceback" not in err
