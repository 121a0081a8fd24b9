"""Action servers and clients across the wire: the whole life of goals, plain and async."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from typing import Any

import pytest

import metaros
from metaros.clock import ManualClock
from metaros.errors import FieldError, PeerError, TimeoutError_, UnavailableError, UsageError
from metaros.interfaces.example_interfaces.action import Fibonacci
from metaros.node.action import ActionClient, ActionServer, ClientGoal, GoalState, ServerGoal
from tests.support.waiting import wait_until

DONE = (GoalState.SUCCEEDED, [0, 1, 1, 2, 3, 5])


@contextmanager
def spinning(*nodes: metaros.Node) -> Iterator[None]:
    executor = metaros.SingleThreadedExecutor()
    for node in nodes:
        executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        yield
    finally:
        executor.shutdown()
        thread.join()


def fibonacci(goal: ServerGoal) -> Any:
    """Plain: steps with feedback, and an eye on the cancel."""
    sequence = [0, 1]
    for _ in range(goal.request.order - 1):
        if goal.is_cancel_requested:
            goal.canceled(Fibonacci.Result(sequence=sequence))
            return None
        sequence.append(sequence[-1] + sequence[-2])
        goal.publish_feedback(Fibonacci.Feedback(sequence=sequence))
    return Fibonacci.Result(sequence=sequence)


async def fibonacci_async(goal: ServerGoal) -> Any:
    """The same on the event loop."""
    await asyncio.sleep(0)
    return fibonacci(goal)


def until_cancelled(goal: ServerGoal) -> None:
    """Goes on until it should stop."""
    goal.publish_feedback(Fibonacci.Feedback(sequence=[1]))
    assert goal.pause(60)
    if goal.is_cancel_requested:
        goal.canceled(Fibonacci.Result(sequence=[7]))


Serve = Callable[..., tuple[ActionServer, ActionClient]]


@pytest.fixture
def serve(here, there) -> Iterator[Serve]:
    """A server in one session and a client in another, both spinning."""
    with ExitStack() as stack:

        def start(execute: Callable[[ServerGoal], Any], **options: Any) -> tuple[ActionServer, ActionClient]:
            server_node = stack.enter_context(metaros.Node("server", context=there))
            client_node = stack.enter_context(metaros.Node("client", context=here))
            server = server_node.create_action_server(Fibonacci, "fibonacci", execute, **options)
            client = client_node.create_action_client(Fibonacci, "fibonacci")
            stack.enter_context(spinning(server_node))
            stack.enter_context(spinning(client_node))
            assert client.wait_for_server(60)
            return server, client

        yield start


def summary(goal: ClientGoal) -> tuple[GoalState, list[int]]:
    status, result = goal.result(60).wait()
    return status, result.sequence.tolist()


def test_feedback_is_heard_that_a_result_has_overtaken(here, there) -> None:
    with metaros.Node("server", context=here) as server, metaros.Node("client", context=there) as node:
        server.create_action_server(Fibonacci, "overtaken", fibonacci)
        client = node.create_action_client(Fibonacci, "overtaken")
        seen: list[int] = []
        with spinning(server):
            assert client.wait_for_server(60)
            for _ in range(40):  # the first sample of a young link may get lost; forty goals, more than are remembered
                goal = client.send_goal(Fibonacci.Goal(order=2), feedback=lambda f: seen.append(len(f.sequence))).wait()
                assert goal.result().wait().status is GoalState.SUCCEEDED
            assert not seen  # the client's node has not spun
        with spinning(node):
            wait_until(lambda: seen)
        assert set(seen) == {3}
        assert len(client._followed) <= 33


@pytest.mark.parametrize("execute", [fibonacci, fibonacci_async])
def test_a_goal_gives_feedback_and_a_result(serve, execute):
    _, client = serve(execute)
    seen: list[list[int]] = []

    def all_feedback() -> bool:  # where the link of the two sessions is young, the first may get lost
        seen.clear()
        goal = client.send_goal(Fibonacci.Goal(order=5), feedback=lambda f: seen.append(f.sequence.tolist())).wait()
        assert goal.accepted
        assert goal.stamp_ns > 1_600_000_000_000_000_000
        assert summary(goal) == DONE
        assert goal.status is GoalState.SUCCEEDED
        assert summary(goal) == DONE  # it is kept
        return len(seen) == 4

    wait_until(all_feedback)
    assert seen[0] == [0, 1, 1]


async def test_everything_can_be_awaited(serve):
    _, client = serve(until_cancelled)
    goal = await client.send_goal(Fibonacci.Goal(order=5))
    waiting = asyncio.ensure_future(goal.result())
    assert await goal.cancel()
    status, result = await waiting
    assert (status, result.sequence.tolist()) == (GoalState.CANCELED, [7])
    assert not await goal.cancel()  # it has ended


def test_a_goal_may_be_refused(serve):
    asked = []

    def wanted(request: Any) -> bool:
        asked.append(request.order)
        if request.order > 100:
            raise RuntimeError("too much")
        return request.order < 10

    _, client = serve(fibonacci, goal=wanted)
    for order, accepted in ((5, True), (50, False), (500, False)):
        goal = client.send_goal(Fibonacci.Goal(order=order)).wait()
        assert goal.accepted is accepted
    assert asked == [5, 50, 500]
    with pytest.raises(UnavailableError, match="does not know"):
        goal.result(60).wait()
    assert goal.status is GoalState.UNKNOWN


def test_the_same_id_is_refused(serve):
    _, client = serve(until_cancelled)
    assert client.send_goal(Fibonacci.Goal(), goal_id=bytes(range(16))).wait().accepted
    assert not client.send_goal(Fibonacci.Goal(), goal_id=bytes(range(16))).wait().accepted


def test_a_cancel_may_be_refused(serve):
    go = threading.Event()

    def execute(goal: ServerGoal) -> Any:
        go.wait(60)
        return fibonacci(goal)

    async def refuse(goal: ServerGoal) -> bool:
        return False

    _, client = serve(execute, cancel=refuse)
    goal = client.send_goal(Fibonacci.Goal(order=5)).wait()
    assert not goal.cancel().wait()
    go.set()
    assert summary(goal) == DONE


def test_cancelling_all_and_by_time(serve):
    server, client = serve(until_cancelled)
    goals = [client.send_goal(Fibonacci.Goal()).wait() for _ in range(3)]
    assert client.cancel_goals(until_ns=goals[1].stamp_ns).wait() == [goal.goal_id for goal in goals[:2]]
    assert client.cancel_goals().wait() == [goals[2].goal_id]
    assert [summary(goal) for goal in goals] == [(GoalState.CANCELED, [7])] * 3
    assert server.active == []


@pytest.mark.parametrize("kind", ["plain", "async"])
def test_an_exception_aborts_the_goal_and_nothing_else(serve, kind, caplog):
    def plain(goal: ServerGoal) -> Any:
        if goal.request.order < 0:
            raise RuntimeError("broken arm")
        return fibonacci(goal)

    async def later(goal: ServerGoal) -> Any:
        return plain(goal)

    _, client = serve(plain if kind == "plain" else later)
    assert summary(client.send_goal(Fibonacci.Goal(order=-1)).wait()) == (GoalState.ABORTED, [])
    assert summary(client.send_goal(Fibonacci.Goal(order=5)).wait()) == DONE
    assert "RuntimeError: broken arm" in caplog.text


def test_no_result_and_wrong_results_abort(serve, caplog):
    def execute(goal: ServerGoal) -> Any:
        return {0: None, 1: "text", 2: Fibonacci.Result(sequence=[1 << 20])}[goal.request.order]

    _, client = serve(execute)
    ends = [summary(client.send_goal(Fibonacci.Goal(order=order)).wait()) for order in range(3)]
    assert ends == [(GoalState.ABORTED, []), (GoalState.ABORTED, []), (GoalState.SUCCEEDED, [1 << 20])]
    assert "returned no result" in caplog.text
    assert "not str" in caplog.text


def test_deferred_goals_run_one_after_the_other(serve):
    waiting: list[ServerGoal] = []
    order: list[int] = []

    def execute(goal: ServerGoal) -> Any:
        order.append(goal.request.order)
        if len(waiting) > len(order):
            waiting[len(order)].execute()
        return Fibonacci.Result()

    def accepted(goal: ServerGoal) -> None:
        waiting.append(goal)

    server, client = serve(execute, handle_accepted=accepted)
    goals = [client.send_goal(Fibonacci.Goal(order=number)).wait() for number in range(3)]
    wait_until(lambda: len(waiting) == 3)
    assert [goal.status for goal in server.active] == [GoalState.ACCEPTED] * 3
    waiting[0].execute()
    assert [summary(goal)[0] for goal in goals] == [GoalState.SUCCEEDED] * 3
    assert order == [0, 1, 2]
    with pytest.raises(UsageError, match="started before"):
        waiting[0].execute()
    server.run_plain(waiting[0])  # as a thread does whose goal ended just before it began
    assert order == [0, 1, 2]
    assert waiting[0].status is GoalState.SUCCEEDED


def test_a_deferred_goal_may_be_dropped_or_cancelled_before_it_begins(serve):
    waiting: list[ServerGoal] = []
    _, client = serve(fibonacci, handle_accepted=waiting.append)
    dropped, cancelled = (client.send_goal(Fibonacci.Goal()).wait() for _ in range(2))
    wait_until(lambda: len(waiting) == 2)
    with pytest.raises(UsageError, match="ACCEPTED cannot"):
        waiting[0].canceled()
    waiting[0].abort()
    assert summary(dropped) == (GoalState.ABORTED, [])
    assert cancelled.cancel().wait()
    assert waiting[1].is_cancel_requested
    waiting[1].canceled(Fibonacci.Result(sequence=[3]))
    assert summary(cancelled) == (GoalState.CANCELED, [3])


def test_a_new_goal_preempts_the_one_before(serve):
    current: list[ServerGoal] = []

    def preempt(goal: ServerGoal) -> None:
        for other in current:
            if other.is_active:
                other.abort(Fibonacci.Result(sequence=[9]))
        current.append(goal)
        goal.execute()

    _, client = serve(until_cancelled, handle_accepted=preempt)
    first, second = (client.send_goal(Fibonacci.Goal()).wait() for _ in range(2))
    assert summary(first) == (GoalState.ABORTED, [9])
    assert second.cancel().wait()
    assert summary(second) == (GoalState.CANCELED, [7])


def test_more_goals_than_threads_wait_and_may_be_cancelled_meanwhile(serve):
    go = threading.Event()
    began: list[int] = []

    def execute(goal: ServerGoal) -> Any:
        began.append(goal.request.order)
        go.wait(60)
        return Fibonacci.Result()

    _, client = serve(execute)
    goals = [client.send_goal(Fibonacci.Goal(order=number)).wait() for number in range(20)]
    wait_until(lambda: len(began) == 16)
    assert goals[19].cancel().wait()
    assert summary(goals[19]) == (GoalState.CANCELED, [])
    go.set()
    assert [summary(goal)[0] for goal in goals[:19]] == [GoalState.SUCCEEDED] * 19
    assert sorted(began) == list(range(19))


def test_results_expire(zenoh_router, here):
    clock = ManualClock()
    with metaros.Context(domain_id=0, connect=zenoh_router, clock=clock) as context:
        node = metaros.Node("server", context=context)
        server = node.create_action_server(Fibonacci, "fibonacci", fibonacci, result_timeout_s=5)
        peer = metaros.Node("client", context=here)
        client = peer.create_action_client(Fibonacci, "fibonacci")
        with spinning(node), spinning(peer):
            assert client.wait_for_server(60)
            goal = client.send_goal(Fibonacci.Goal(order=5)).wait()
            assert summary(goal) == DONE
            clock.advance(4.9)
            node.ingress.wake()
            assert summary(goal) == DONE
            clock.advance(0.2)
            node.ingress.wake()

            def gone() -> bool:
                try:
                    goal.result(60).wait()
                except UnavailableError:
                    return True
                return False

            wait_until(gone)
        assert server.active == []


def test_status_is_reported_to_late_clients(serve, here):
    _, client = serve(until_cancelled)
    goal = client.send_goal(Fibonacci.Goal()).wait()
    wait_until(lambda: goal.status is GoalState.EXECUTING)
    with metaros.Node("late", context=here) as late:
        seen: list[Any] = []
        kind = metaros.qos_transient_local
        from metaros.interfaces.action_msgs.msg import GoalStatusArray

        late.create_subscription(GoalStatusArray, "/fibonacci/_action/status", seen.append, kind, dedicated=True)
        wait_until(lambda: seen)
        (entry,) = seen[-1].status_list
        assert bytes(entry.goal_info.goal_id.uuid) == goal.goal_id
        assert entry.status == GoalState.EXECUTING
    assert goal.cancel().wait()
    wait_until(lambda: goal.status is GoalState.CANCELED)


def test_a_server_that_closes_ends_the_wait_at_once(serve):
    server, client = serve(until_cancelled)
    goal = client.send_goal(Fibonacci.Goal()).wait()
    pending = goal.result()
    threading.Timer(0.05, server.close).start()
    with pytest.raises(UnavailableError):
        pending.wait()
    wait_until(lambda: not client.server_is_ready())
    with pytest.raises(UnavailableError):
        client.send_goal(Fibonacci.Goal()).wait()


def test_deadlines_and_misuse_are_reported(serve):
    _, client = serve(until_cancelled)
    goal = client.send_goal(Fibonacci.Goal()).wait()
    with pytest.raises(TimeoutError_):
        goal.result(0.1).wait()
    pending = goal.result()
    pending.cancel()
    assert pending.done
    with pytest.raises(PeerError, match="cancelled"):
        pending.wait()
    with pytest.raises(FieldError, match="Goal"):
        client.send_goal(Fibonacci.Result())
    node = client.node
    with pytest.raises(UsageError, match="no action class"):
        node.create_action_client(Fibonacci.Goal, "x")
    with pytest.raises(UsageError, match="zero seconds"):
        node.create_action_server(Fibonacci, "x", fibonacci, result_timeout_s=-1)
    with pytest.raises(UsageError, match="positional"):
        node.create_action_server(Fibonacci, "x", lambda: None)


def test_a_callback_that_waits_for_its_own_executor_is_reported(there):
    errors: list[Exception] = []
    with metaros.Node("both", context=there) as node:
        node.create_action_server(Fibonacci, "fibonacci", fibonacci)
        client = node.create_action_client(Fibonacci, "fibonacci")

        @node.timer(0.01)
        def tick() -> None:
            try:
                client.send_goal(Fibonacci.Goal()).wait()
            except UsageError as error:
                errors.append(error)

        with spinning(node):
            wait_until(lambda: errors)
    assert "wait for itself" in str(errors[0])
