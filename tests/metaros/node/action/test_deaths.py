"""Processes that are killed or simply end, with calls and goals in flight: nobody hangs, everybody is told."""

from __future__ import annotations

import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

import metaros
from metaros.errors import PeerRestartedError, UnavailableError
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.interfaces.std_srvs.srv import Trigger
from metaros.node.action import GoalState, ServerGoal
from tests.support.processes.forked import ended, forked
from tests.support.processes.processes import started
from tests.support.waiting import wait_until

ROOT = Path(__file__).resolve().parents[4]
_SOON_S = 60.0  # far below any deadline in here: what ends sooner did not wait for one

PRELUDE = """
import sys, threading
import metaros
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.interfaces.std_srvs.srv import Trigger

for_ever = threading.Event()
context = metaros.Context(domain_id=0, connect=sys.argv[1])
node = metaros.Node("other", context=context)
"""

SERVER = """
def execute(goal):
    goal.publish_feedback(Fibonacci.Feedback(sequence=[1]))
    for_ever.wait(10_000)  # deaf: not even a cancel wakes it

node.create_action_server(Fibonacci, "fibonacci", execute)
node.create_service(Trigger, "never", lambda request, response: for_ever.wait(10_000))
print("ready", flush=True)
metaros.spin(node)
"""

CLIENT = """
client = node.create_action_client(Fibonacci, "fibonacci")
assert client.wait_for_server(60)
goal = client.send_goal(Fibonacci.Goal(order=5)).wait()
pending = goal.result()
print("ready", flush=True)
"""


def program(*parts: str) -> str:
    return "".join(textwrap.dedent(part) for part in (PRELUDE, *parts))


@contextmanager
def running(code: str, router: str) -> Iterator[subprocess.Popen[str]]:
    """A process that has said that it is ready."""
    command = [sys.executable, "-c", code, router]
    with started(command, cwd=ROOT) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n", process.stderr and process.stderr.read()
        yield process


IMPORTS = """
import asyncio, threading
import metaros, metaros.executor, metaros.node, metaros.node.action
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.interfaces.std_srvs.srv import Trigger
"""
CHILD = """
for_ever = threading.Event()
context = metaros.Context(domain_id=0, connect={router!r})
node = metaros.Node("other", namespace=f"/n{{number}}", context=context)
"""


def children(codes: list[str], router: str) -> list[str]:
    """Programs with a node each, in the namespaces /n0, /n1, …"""
    return [CHILD.format(router=router) + code for code in codes]


@pytest.fixture
def node(here: metaros.Context) -> Iterator[metaros.Node]:
    """A node that spins."""
    with metaros.Node("survivor", context=here) as made:
        executor = metaros.SingleThreadedExecutor()
        executor.add_node(made)
        thread = threading.Thread(target=executor.spin)
        thread.start()
        yield made
        executor.shutdown()
        thread.join()


@pytest.mark.integration
def test_a_server_killed_mid_goal_fails_the_result_at_once(node: metaros.Node, zenoh_router: str) -> None:
    client = node.create_action_client(Fibonacci, "fibonacci")
    trigger = node.create_client(Trigger, "never")
    with running(program(SERVER), zenoh_router) as server:
        assert client.wait_for_server(60)
        goal = client.send_goal(Fibonacci.Goal()).wait()
        wait_until(lambda: goal.status is GoalState.EXECUTING)
        result, call = goal.result(timeout_s=100), trigger.call_future(Trigger.Request(), timeout_s=100)
        server.kill()
        began_s = time.monotonic()
        with pytest.raises(PeerRestartedError) as raised:
            result.wait()
        assert raised.value.code == "peer_restarted"
        with pytest.raises(UnavailableError):
            call.result(100)
        assert time.monotonic() - began_s < _SOON_S
        wait_until(lambda: not client.server_is_ready())
        with pytest.raises(PeerRestartedError):
            goal.cancel().wait()
    with running(program(SERVER), zenoh_router):  # as a supervisor would: it knows nothing of the goal
        assert client.wait_for_server(60)
        with pytest.raises(PeerRestartedError, match="restarted since"):
            goal.result(timeout_s=60).wait()
        assert client.send_goal(Fibonacci.Goal()).wait().accepted


def test_a_goal_survives_its_client_and_is_kept(node: metaros.Node, zenoh_router: str) -> None:
    go = threading.Event()
    goals: list[ServerGoal] = []

    def execute(goal: ServerGoal) -> Any:
        goals.append(goal)
        go.wait(60)
        goal.publish_feedback(Fibonacci.Feedback(sequence=[1]))
        return Fibonacci.Result(sequence=[5])

    server = node.create_action_server(Fibonacci, "fibonacci", execute)
    with running(program(CLIENT, "pending.wait()"), zenoh_router) as client:
        wait_until(lambda: goals and goals[0].waiters)
        client.kill()
    go.set()
    wait_until(lambda: (goals[0].status, goals[0].waiters, server.active) == (GoalState.SUCCEEDED, [], []))
    own = node.create_action_client(Fibonacci, "fibonacci")  # and the server serves others
    assert own.send_goal(Fibonacci.Goal()).wait().result(60).wait().result.sequence.tolist() == [5]


ENDINGS = (
    "context.close()",
    "node.close()",
    "pass",  # falls off the end, with everything open
    "raise SystemExit(0)",
    "threading.Thread(target=pending.wait, daemon=True).start()",
    "threading.Thread(target=metaros.spin, args=(node,), daemon=True).start()",
)


@pytest.mark.integration
def test_a_client_with_a_goal_in_flight_can_end(node: metaros.Node, zenoh_router: str) -> None:
    node.create_action_server(Fibonacci, "fibonacci", lambda goal: goal.pause(1000) and None)
    clients = [CLIENT.replace("fibonacci", "/fibonacci") + ending for ending in ENDINGS]
    with forked(children(clients, zenoh_router), imports=IMPORTS) as process:
        codes, complaints = ended(process, ready=True)
        assert codes == dict.fromkeys(range(len(ENDINGS)), 0), complaints


EXECUTES = (
    "def execute(goal): for_ever.wait(10_000)",  # blocks for ever
    "def execute(goal): goal.pause(10_000)",
    "async def execute(goal):\n    import asyncio\n    await asyncio.sleep(10_000)",
    "def execute(goal): raise RuntimeError('broken')",
    "def execute(goal):\n    while True: goal.publish_feedback(Fibonacci.Feedback())",
)
STOPPED = """
node.create_action_server(Fibonacci, "fibonacci", execute)
executor = metaros.SingleThreadedExecutor()
executor.add_node(node)

@node.service(Trigger, "stop")
def stop(request, response):
    executor.shutdown()

print("ready", flush=True)
executor.spin()
"""


@pytest.mark.integration
def test_a_server_with_a_goal_in_flight_can_end(node: metaros.Node, zenoh_router: str) -> None:
    """Its executor is shut down and the interpreter ends, whatever the goal does."""
    servers = [f"{execute}\n{STOPPED}" for execute in EXECUTES]
    with forked(children(servers, zenoh_router), imports=IMPORTS) as process:
        for number in range(len(EXECUTES)):
            client = node.create_action_client(Fibonacci, f"/n{number}/fibonacci")
            stop = node.create_client(Trigger, f"/n{number}/stop")
            assert client.wait_for_server(60)
            assert stop.wait_for_service(60)
            pending = client.send_goal(Fibonacci.Goal()).wait().result()
            stop.call(Trigger.Request(), timeout_s=60)
            began_s = time.monotonic()
            with suppress(UnavailableError):
                assert pending.wait().status is GoalState.ABORTED
            assert time.monotonic() - began_s < _SOON_S
        codes, complaints = ended(process, ready=True)
        assert codes == dict.fromkeys(range(len(EXECUTES)), 0), complaints
