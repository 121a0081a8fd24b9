"""The executor with a pool of threads."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.callback_groups import MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.executors import MultiThreadedExecutor
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rosidl.catalogue import interface
from tests.support.waiting import wait_until


class Meeting:
    """Callbacks that wait for each other: only those that overlap ever meet."""

    def __init__(self, expected: int) -> None:
        self.barrier = threading.Barrier(expected)
        self.met = Future[None]()

    def __call__(self, *_: Any) -> None:
        """Meet the others."""
        self.barrier.wait(5)
        self.met.set_result(None)


def test_callbacks_of_a_reentrant_group_overlap_with_themselves_too(node: Node, pool: MultiThreadedExecutor) -> None:
    string, group = interface("std_msgs/msg/String"), ReentrantCallbackGroup()
    pool.add_node(node)
    subscribers, timers, guards = Meeting(3), Meeting(2), Meeting(2)
    node.create_subscription(string, "meet", subscribers, 10, callback_group=group)
    publisher = node.create_publisher(string, "meet", 10)
    for _ in range(3):
        publisher.publish(string())
    pool.spin_until_future_complete(subscribers.met, timeout_sec=5)
    guard = node.create_guard_condition(guards, callback_group=group)
    guard.trigger()
    wait_until(lambda: pool.spin_once(timeout_sec=0) or not guard.handle.triggered)
    guard.trigger()
    pool.spin_until_future_complete(guards.met, timeout_sec=5)
    node.create_timer(0.001, timers, callback_group=group)
    pool.spin_until_future_complete(timers.met, timeout_sec=5)
    assert [meeting.met.done() for meeting in (subscribers, timers, guards)] == [True] * 3


def test_callbacks_of_one_exclusive_group_never_do_and_keep_their_order(
    node: Node, pool: MultiThreadedExecutor
) -> None:
    string = interface("std_msgs/msg/String")
    inside, worst, heard, done = 0, 0, list[int](), Future[None]()

    def callback(message: Any) -> None:
        nonlocal inside, worst
        inside += 1
        worst = max(worst, inside)
        threading.Event().wait(0.0001)  # the others have their chance
        inside -= 1
        heard.append(int(message.data))
        if len(heard) == 200:
            done.set_result(None)

    pool.add_node(node)
    for topic in ("one", "two"):
        node.create_subscription(string, topic, callback, 1000)
    publishers = [node.create_publisher(string, topic, 1000) for topic in ("one", "two")]
    for number in range(100):
        for offset, publisher in enumerate(publishers):
            publisher.publish(string(data=str(2 * number + offset)))
    pool.spin_until_future_complete(done, timeout_sec=10)
    assert worst == 1
    for offset in (0, 1):
        assert [number for number in heard if number % 2 == offset] == list(range(offset, 200, 2))


def test_two_exclusive_groups_run_beside_each_other(node: Node, pool: MultiThreadedExecutor) -> None:
    meeting = Meeting(2)
    pool.add_node(node)
    for _ in range(2):
        node.create_guard_condition(meeting, callback_group=MutuallyExclusiveCallbackGroup()).trigger()
    pool.spin_until_future_complete(meeting.met, timeout_sec=5)
    assert meeting.met.done()


def test_what_waits_for_a_thread_is_handed_out_once(node: Node, pool: MultiThreadedExecutor) -> None:
    may_end, calls, group = threading.Event(), list[str](), ReentrantCallbackGroup()
    pool.add_node(node)
    blockers = [node.create_guard_condition(lambda: may_end.wait(5), callback_group=group) for _ in range(3)]
    for guard in blockers:
        guard.trigger()
    for _ in range(3):
        pool.spin_once(timeout_sec=5)
    wait_until(lambda: not any(guard.handle.triggered for guard in blockers))
    node.create_guard_condition(lambda: calls.append("guard"), callback_group=group).trigger()
    node.create_timer(0, lambda: calls.append("timer"), callback_group=group)
    for _ in range(5):
        pool.spin_once(timeout_sec=0)
    may_end.set()
    wait_until(lambda: len(calls) == 2)
    pool.shutdown()
    assert sorted(calls) == ["guard", "timer"]


def test_a_callback_may_wait_for_a_response(node: Node, pool: MultiThreadedExecutor) -> None:
    """The server's and the client's callbacks are in other groups than the one that waits."""
    pool.add_node(node)
    service = interface("std_srvs/srv/Trigger")
    group, answers = MutuallyExclusiveCallbackGroup(), list[Any]()

    def serve(request: Any, response: Any) -> Any:
        response.message = "served"
        return response

    node.create_service(service, "serve", serve, callback_group=ReentrantCallbackGroup())
    client = node.create_client(service, "serve", callback_group=ReentrantCallbackGroup())
    done = Future[None]()

    def asks() -> None:
        answers.append(client.call(service.Request()))
        done.set_result(None)

    node.create_guard_condition(asks, callback_group=group).trigger()
    pool.spin_until_future_complete(done, timeout_sec=5)
    assert [answer.message for answer in answers] == ["served"]


def test_coroutines_tasks_and_what_is_raised(node: Node, pool: MultiThreadedExecutor) -> None:
    gate, calls = Future[None](), list[str]()

    async def waits() -> None:
        calls.append("begins")
        await gate
        calls.append("ends")
        raise KeyError("lost")

    pool.add_node(node)
    node.create_guard_condition(waits).trigger()
    pool.spin_once(timeout_sec=5)
    wait_until(lambda: calls == ["begins"])
    task = pool.create_task(lambda: 5)
    pool.spin_until_future_complete(task, timeout_sec=5)
    assert task.result() == 5
    gate.set_result(None)
    with pytest.raises(KeyError, match="lost"):
        pool.spin()
    assert calls == ["begins", "ends"]


def test_shutdown_lets_what_runs_end_and_gives_back_the_rest(node: Node, rclpy_context: Context) -> None:
    string = interface("std_msgs/msg/String")
    running, may_end, heard = threading.Event(), threading.Event(), list[str]()

    def slow(message: Any) -> None:
        heard.append(message.data)
        running.set()
        may_end.wait(5)

    pool = MultiThreadedExecutor(num_threads=2, context=rclpy_context)
    pool.add_node(node)
    node.create_subscription(string, "slow", slow, 10, callback_group=ReentrantCallbackGroup())
    publisher = node.create_publisher(string, "slow", 10)
    for data in "abcde":
        publisher.publish(string(data=data))
    thread = threading.Thread(target=pool.spin, daemon=True)
    thread.start()
    wait_until(lambda: len(heard) == 2)
    assert not pool.shutdown(timeout_sec=0.01)
    threading.Timer(0.02, may_end.set).start()
    assert pool.shutdown()
    thread.join(5)
    assert sorted(heard) == ["a", "b"]
    running.clear()
    with MultiThreadedExecutor(num_threads=2, context=rclpy_context) as other:
        other.add_node(node)
        for _ in range(10):
            other.spin_once(timeout_sec=0.001)
        wait_until(lambda: len(heard) == 5)
    assert sorted(heard) == list("abcde")


def test_a_callback_may_shut_the_pool_down(node: Node, rclpy_context: Context) -> None:
    pool, calls = MultiThreadedExecutor(num_threads=2, context=rclpy_context), list[bool]()
    pool.add_node(node)
    node.create_guard_condition(lambda: calls.append(pool.shutdown())).trigger()
    pool.spin()
    wait_until(lambda: calls == [True])
    pool.shutdown()


def test_the_number_of_threads(rclpy_context: Context) -> None:
    with pytest.warns(UserWarning, match="with a single thread"):
        MultiThreadedExecutor(1, context=rclpy_context).shutdown()
    with MultiThreadedExecutor(context=rclpy_context) as pool:
        assert pool._executor._max_workers >= 1
