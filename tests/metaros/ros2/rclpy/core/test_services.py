"""Clients and service servers on an executor, and what they tell of their calls."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import pytest

from metaros.errors import UsageError
from metaros.ros2.rclpy import create_node
from metaros.ros2.rclpy.core.client import Client
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.core.service_introspection import ServiceIntrospectionState
from metaros.ros2.rclpy.execution.callback_groups import ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rclpy.qos.profile import qos_profile_system_default
from metaros.ros2.rosidl.catalogue import interface
from tests.support.nodes.threads import on_thread
from tests.support.waiting import wait_until

ADD = "example_interfaces/srv/AddTwoInts"


@pytest.fixture(name="node")
def _node(rclpy_context: Context) -> Iterator[Node]:
    with create_node("probe", context=rclpy_context) as node:
        yield node


@pytest.fixture(name="executor")
def _executor(rclpy_context: Context, node: Node) -> Iterator[SingleThreadedExecutor]:
    with SingleThreadedExecutor(context=rclpy_context) as executor:
        executor.add_node(node)
        yield executor


def add(request: Any, response: Any) -> Any:
    response.sum = request.a + request.b
    return response


def request_of(a: int, b: int) -> Any:
    return interface(ADD).Request(a=a, b=b)


def sum_of(future: Future[Any]) -> int:
    response = future.result()
    assert response is not None
    return int(response.sum)


def client_of(node: Node, **options: Any) -> Client:
    client = node.create_client(interface(ADD), "add", **options)
    assert client.wait_for_service(timeout_sec=30)
    return client


def test_a_future_is_completed_by_the_executor(node: Node, executor: SingleThreadedExecutor) -> None:
    service = node.create_service(interface(ADD), "add", add)
    client = client_of(node)
    assert (client.service_name, service.service_name, client.logger_name) == ("/add", "/add", "probe")
    futures = [client.call_async(request_of(1, number)) for number in range(3)]
    assert client.get_pending_request(2) is futures[1]
    assert not any(future.done() for future in futures)
    for future in futures:
        executor.spin_until_future_complete(future, timeout_sec=30)
    assert [sum_of(future) for future in futures] == [1, 2, 3]
    with pytest.raises(KeyError):
        client.get_pending_request(2)
    for call in (client.call, client.call_async):
        with pytest.raises(TypeError, match="Expected"):
            call("different")


def test_coroutines_await_calls(node: Node, executor: SingleThreadedExecutor) -> None:
    group = ReentrantCallbackGroup()
    client = node.create_client(interface(ADD), "add", callback_group=group)

    async def twice(request: Any, response: Any) -> Any:
        for _ in range(2):
            response.sum += (await client.call_async(request)).sum
        return response

    node.create_service(interface(ADD), "add", add, callback_group=group)
    node.create_service(interface(ADD), "twice", twice, callback_group=group)
    outer = node.create_client(interface(ADD), "twice", callback_group=group)
    future = outer.call_async(request_of(2, 3))
    executor.spin_until_future_complete(future, timeout_sec=30)
    assert sum_of(future) == 10


def test_a_blocking_call_needs_nobody_who_spins_its_node(
    rclpy_context: Context, node: Node, executor: SingleThreadedExecutor
) -> None:
    with create_node("server", context=rclpy_context) as server:
        server.create_service(interface(ADD), "add", add)
        client = client_of(node)
        assert client.call(request_of(1, 2), timeout_sec=0.01) is None  # nobody serves
        with SingleThreadedExecutor(context=rclpy_context) as serving:
            serving.add_node(server)
            thread = threading.Thread(target=serving.spin)
            thread.start()
            try:
                assert client.call(request_of(1, 2)).sum == 3
                assert client.call(request_of(1, 2), timeout_sec=30).sum == 3
            finally:
                serving.shutdown()
                thread.join()
    assert node.create_client(interface(ADD), "none").call(request_of(1, 2), timeout_sec=0) is None


def test_a_call_that_would_wait_for_itself_says_so(node: Node, executor: SingleThreadedExecutor) -> None:
    node.create_service(interface(ADD), "add", add)
    client = client_of(node)
    node.create_timer(0.0, lambda: client.call(request_of(1, 2)))
    with pytest.raises(UsageError, match="would wait for itself"):
        executor.spin_once(timeout_sec=30)


def test_what_a_servers_callback_raises_comes_out_of_spin(node: Node, executor: SingleThreadedExecutor) -> None:
    outcomes: list[Any] = [ValueError("no"), "no response", None]

    def serve(request: Any, response: Any) -> Any:
        outcome = outcomes[0]
        if isinstance(outcome, Exception):
            raise outcome
        return outcome

    async def serve_later(request: Any, response: Any) -> Any:
        return serve(request, response)

    for name, callback in (("plain", serve), ("later", serve_later)):
        node.create_service(interface(ADD), name, callback)
        client = node.create_client(interface(ADD), name)
        for outcome, error in zip(list(outcomes), (ValueError, TypeError, TypeError), strict=True):
            outcomes[0] = outcome
            future = client.call_async(request_of(1, 2))
            with pytest.raises(error):
                executor.spin_until_future_complete(future, timeout_sec=30)
            for _ in range(3):
                executor.spin_once(timeout_sec=0.01)
            assert not future.done()
            wait_until(lambda: not client.handle._calls)  # noqa: B023  (it was told that no answer comes)
        outcomes[0] = ValueError("no")


def test_waits_end_with_the_context_however_that_ends(
    node: Node, ros2_router: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("METAROS_ZENOH_PORT", ros2_router)
    node.create_service(interface(ADD), "unanswered", add)  # nobody spins it
    context, answers = Context(), []
    context.init(args=[])
    with create_node("asker", context=context) as asker:
        client = asker.create_client(interface(ADD), "unanswered")
        assert client.wait_for_service(30.0)
        never = asker.create_client(interface(ADD), "never")
        threads = [
            on_thread(lambda: answers.append(client.call(request_of(1, 2)))),
            on_thread(lambda: answers.append(never.call(request_of(1, 2), timeout_sec=1000.0))),
            on_thread(lambda: answers.append(asker.wait_for_node("/nobody", 1000.0))),
        ]
        wait_until(lambda: context._wakers)
        context._end_by_signal()
        for thread, raised in threads:
            thread.join(20.0)
            assert (thread.is_alive(), raised) == (False, [])
        assert client.call(request_of(1, 2)) is None
    context.shutdown()
    assert sorted(map(str, answers)) == ["False", "None", "None"]


def test_without_an_answer_a_future_stays_open(node: Node, executor: SingleThreadedExecutor) -> None:
    client = node.create_client(interface(ADD), "add")
    assert not client.wait_for_service(timeout_sec=0)
    unheard = client.call_async(request_of(1, 2))
    executor.spin_once(timeout_sec=0.05)
    assert not unheard.done()
    service = node.create_service(interface(ADD), "add", add)
    assert client.wait_for_service(timeout_sec=30)
    forgotten, wanted = client.call_async(request_of(1, 2)), client.call_async(request_of(3, 4))
    assert len(client.handle._calls) == 2
    client.remove_pending_request(forgotten)
    assert len(client.handle._calls) == 1
    executor.spin_until_future_complete(wanted, timeout_sec=30)
    assert sum_of(wanted) == 7
    assert not forgotten.done()
    unanswered = client.call_async(request_of(1, 2))
    node.destroy_service(service)
    executor.spin_once(timeout_sec=0.05)
    assert not unanswered.done()


def test_requests_may_be_taken_and_answered_by_hand(node: Node, executor: SingleThreadedExecutor) -> None:
    service = node.create_service(interface(ADD), "add", add)
    client = client_of(node)
    assert service.handle.service_take_request(interface(ADD).Request) == (None, None)
    future = client.call_async(request_of(1, 2))
    taken: list[Any] = []

    def take() -> bool:
        with service.handle as handle:
            taken[:] = handle.service_take_request(interface(ADD).Request)
        return taken[0] is not None

    wait_until(take)
    request, header = taken
    assert (request.a, request.b) == (1, 2)
    assert 0 < header.source_timestamp <= header.received_timestamp
    with pytest.raises(TypeError):
        service.send_response(request, header)
    service.send_response(interface(ADD).Response(sum=9), header)
    executor.spin_until_future_complete(future, timeout_sec=30)
    assert sum_of(future) == 9


def test_calls_are_told_of_on_a_topic(node: Node, executor: SingleThreadedExecutor) -> None:
    states, event = ServiceIntrospectionState, interface(ADD).Event
    service = node.create_service(interface(ADD), "add", add)
    client = client_of(node)
    events: list[Any] = []
    node.create_subscription(event, "add/_service_event", events.append, 10)
    shapes: dict[ServiceIntrospectionState, list[tuple[int, int, int]]] = {}
    for state in states:
        for endpoint in (client, service):
            endpoint.configure_introspection(node.get_clock(), qos_profile_system_default, state)
        del events[:]
        future: Future[Any] = client.call_async(request_of(1, 2))
        executor.spin_until_future_complete(future, timeout_sec=30)
        wanted = 0 if state is states.OFF else 4
        while len(events) < wanted:
            executor.spin_once(timeout_sec=30)
        shapes[state] = sorted((e.info.event_type, len(e.request), len(e.response)) for e in events)
        assert {e.info.sequence_number for e in events} <= {2, 3}  # the first was told of to nobody
        assert {bytes(e.info.client_gid) for e in events} <= {client.handle.gid}
        assert all(e.info.stamp.sec > 0 for e in events)
    assert shapes == {
        states.OFF: [],
        states.METADATA: [(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)],
        states.CONTENTS: [(0, 1, 0), (1, 1, 0), (2, 0, 1), (3, 0, 1)],
    }
    contents = {e.info.event_type: e for e in events}
    assert (contents[1].request[0].b, contents[3].response[0].sum) == (2, 3)
    topics = [name for name, _ in node.get_publisher_names_and_types_by_node("probe", "/")]
    assert "/add/_service_event" in topics
    node.destroy_client(client)
    node.destroy_service(service)
    assert node.count_publishers("add/_service_event") == 0
