"""`metaros action` against a real action server."""

from __future__ import annotations

import json
import signal
import sys
import threading
from collections.abc import Iterator
from typing import Any

import pytest

import metaros
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.node.action import ServerGoal
from tests.metaros.cli.conftest import Run
from tests.support.processes import END_S, started

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


@pytest.fixture(autouse=True)
def server(zenoh_router: str) -> Iterator[metaros.Node]:
    """/math/counter serves /math/fibonacci."""
    with (
        metaros.Context(connect=zenoh_router) as context,
        metaros.Node("counter", namespace="/math", context=context) as node,
    ):
        node.create_action_server(Fibonacci, "fibonacci", execute, goal=lambda request: request.order != REJECT)
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(node)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield node
        executor.shutdown()
        thread.join()


def test_list_type_find_info(run: Run, server: metaros.Node) -> None:
    assert run("action", "list").stdout == "/math/fibonacci\n"
    assert run("action", "list", "-t").stdout == "/math/fibonacci [example_interfaces/action/Fibonacci]\n"
    assert run("action", "list", "-c").stdout == "1\n"
    assert run("action", "type", "math/fibonacci").stdout == "example_interfaces/action/Fibonacci\n"
    assert run("action", "find", "example_interfaces/Fibonacci").stdout == "/math/fibonacci\n"
    server.create_action_client(Fibonacci, "/math/fibonacci")
    assert run("action", "info", "/math/fibonacci").stdout.splitlines() == [
        "Action: /math/fibonacci",
        "Type: example_interfaces/action/Fibonacci",
        "Action clients: 1",
        "    /math/counter",
        "Action servers: 1",
        "    /math/counter",
    ]
    facts = json.loads(run("action", "info", "/math/fibonacci", "-o", "json").stdout)
    assert facts["servers"] == ["/math/counter"]


def test_an_action_s_topics_and_services_are_hidden(run: Run) -> None:
    assert "_action" not in run("topic", "list").stdout + run("service", "list").stdout
    assert "/math/fibonacci/_action/feedback" in run("topic", "list", "--include-hidden-topics").stdout
    assert "action /math/fibonacci  example_interfaces/action/Fibonacci" in run("graph").stdout


def test_a_node_s_actions(run: Run) -> None:
    facts = json.loads(run("node", "info", "/math/counter", "-o", "json").stdout)
    assert facts["action_servers"] == [{"name": "/math/fibonacci", "type": "example_interfaces/action/Fibonacci"}]
    assert facts["action_clients"] == []
    assert "_action" not in run("node", "info", "/math/counter").stdout
    assert "/math/fibonacci/_action/send_goal" in run("node", "info", "/math/counter", "--include-hidden").stdout


def test_a_goal_from_sending_to_result(run: Run) -> None:
    done = run("action", "send_goal", "/math/fibonacci", "{order: 4}", "--feedback")
    assert done.returncode == 0, done.stderr
    assert "Sending goal:\n    order: 4\n" in done.stdout
    assert done.stdout.count("Feedback:") == 3
    assert done.stdout.endswith("Result:\n    sequence: [0, 1, 1, 2, 3]\n\nGoal finished with status: SUCCEEDED\n")


def test_a_goal_as_lines_of_json(run: Run) -> None:
    done = run(
        "action", "send_goal", "math/fibonacci", "example_interfaces/Fibonacci", "{order: 2}", "-f", "-o", "json"
    )
    first, *feedback, last = [json.loads(line) for line in done.stdout.splitlines()]
    assert first["accepted"]
    assert feedback == [{"feedback": {"sequence": [0, 1, 1]}}]
    assert last == {"status": "SUCCEEDED", "result": {"sequence": [0, 1, 1]}}


@pytest.mark.parametrize(
    ("arguments", "code", "word"),
    [
        (("info", "/math/fibonaci"), 1, "did you mean /math/fibonacci?"),
        (("type", "/math/fibonaci"), 1, "did you mean /math/fibonacci?"),
        (("send_goal", "/math/fibonaci", "{order: 1}"), 1, "did you mean /math/fibonacci?"),
        (("send_goal", "/math/fibonacci", "{ordr: 1}"), 2, "order"),
        (("send_goal", "/math/fibonacci", "tf2_msgs/LookupTransform", "{}"), 2, "example_interfaces/action/Fibonacci"),
        (("send_goal", "/math/fibonacci", f"{{order: {REJECT}}}"), 1, "rejected"),
        (("find", "example_interfaces/Fibonaci"), 2, "example_interfaces/action/Fibonacci"),
    ],
)
def test_errors_help(run: Run, arguments: tuple[str, ...], code: int, word: str) -> None:
    done = run("action", *arguments)
    assert done.returncode == code
    assert word in done.stderr
    assert "Traceback" not in done.stderr


def test_an_aborted_goal_is_exit_code_1(run: Run) -> None:
    done = run("action", "send_goal", "/math/fibonacci", f"{{order: {ABORT}}}")
    assert done.returncode == 1
    assert "Goal finished with status: ABORTED" in done.stdout


def test_ctrl_c_cancels_the_goal(zenoh_router: str) -> None:
    port = zenoh_router.rsplit(":", 1)[1]
    command = [sys.executable, "-m", "metaros", "action", "send_goal", "/math/fibonacci", f"{{order: {HOLD}}}", "-f"]
    with started([*command, "--zenoh-port", port]) as sent:
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
