"""Tasks, nodes and the end of executors."""

from __future__ import annotations

import asyncio
import gc
import threading
from typing import Any

import pytest

from metaros.errors import UsageError
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.executors import (
    ExternalShutdownException,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
    await_or_execute,
)
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rosidl.catalogue import interface
from tests.support.nodes.threads import on_thread
from tests.support.waiting import wait_until

_DUE_S = 0.001


# -- tasks -------------------------------------------------------------------------------------------------------------


def test_tasks(executor: SingleThreadedExecutor) -> None:
    async def coroutine(value: int) -> int:
        return value + 1

    tasks = [executor.create_task(coroutine, 1), executor.create_task(lambda value: value, value=3)]
    tasks.append(executor.create_task(coroutine(4)))
    assert not any(task.done() for task in tasks)
    for _ in tasks:
        executor.spin_once(timeout_sec=0)
    assert [task.result() for task in tasks] == [2, 3, 5]
    assert not executor._pending_tasks


def test_a_task_awaits_another_and_the_newest_runs_first(executor: SingleThreadedExecutor) -> None:
    async def first() -> str:
        return "first"

    one = executor.create_task(first)

    async def second() -> str:
        return f"after {await one}"

    two = executor.create_task(second)
    executor.spin_once(timeout_sec=0)
    executor.spin_once(timeout_sec=0)
    assert one.done()
    assert not two.done()
    executor.spin_once(timeout_sec=1)
    assert two.result() == "after first"


def test_a_waiting_task_costs_nothing_and_survives_a_collection(executor: SingleThreadedExecutor) -> None:
    future, rounds = Future[int](), 0

    async def waits() -> int | None:
        nonlocal rounds
        rounds += 1
        return await future

    task = executor.create_task(waits)
    executor.spin_once(timeout_sec=0)
    gc.collect()
    executor.spin_once(timeout_sec=0.01)  # nothing is ready
    future.set_result(5)
    executor.spin_until_future_complete(task, timeout_sec=5)
    assert (task.result(), rounds) == (5, 1)


def test_one_that_polls_for_long_is_run_a_thousand_times_a_second_at_most(executor: SingleThreadedExecutor) -> None:
    polls = 0

    async def poll() -> None:
        nonlocal polls
        while polls < 1_000_000:
            polls += 1
            await asyncio.sleep(0)

    task = executor.create_task(poll)
    executor.spin_until_future_complete(Future[None](), timeout_sec=0.05)
    assert 20 < polls < 1000
    task.cancel()
    executor.spin_once(timeout_sec=0)
    assert not executor._pending_tasks


def test_done_callbacks_of_a_task_run_on_the_executor(executor: SingleThreadedExecutor) -> None:
    called = list[Any]()
    task = executor.create_task(lambda: 5)
    task.add_done_callback(called.append)
    executor.spin_once(timeout_sec=0)
    assert called == []
    executor.spin_once(timeout_sec=0)
    assert called == [task]
    future = executor.create_future()
    future.add_done_callback(called.append)
    future.set_result(1)
    executor.spin_once(timeout_sec=0)
    assert called == [task, future]


def test_await_or_execute(executor: SingleThreadedExecutor) -> None:
    async def coroutine(value: int) -> int:
        return value

    tasks = [executor.create_task(await_or_execute, callback, 5) for callback in (coroutine, abs)]
    for _ in tasks:
        executor.spin_once(timeout_sec=0)
    assert [task.result() for task in tasks] == [5, 5]


# -- nodes -------------------------------------------------------------------------------------------------------------


def test_a_node_has_one_executor(node: Node, executor: SingleThreadedExecutor, rclpy_context: Context) -> None:
    assert executor.add_node(node)
    assert not executor.add_node(node)
    assert node.executor is executor
    assert executor.get_nodes() == [node]
    with SingleThreadedExecutor(context=rclpy_context) as other:
        assert other.add_node(node)
        assert (executor.get_nodes(), other.get_nodes(), node.executor) == ([], [node], other)
        executor.remove_node(node)
        assert node.executor is other


def test_what_waits_goes_with_the_node_to_its_next_executor(
    node: Node, executor: SingleThreadedExecutor, rclpy_context: Context
) -> None:
    string = interface("std_msgs/msg/String")
    heard = list[str]()
    for topic in ("one", "two", "three"):
        node.create_subscription(string, topic, lambda message: heard.append(message.data), 10)
        node.create_publisher(string, topic, 10).publish(string(data=topic))
    executor.add_node(node)
    executor.spin_once(timeout_sec=0)
    executor.remove_node(node)
    dropped = SingleThreadedExecutor(context=rclpy_context)
    dropped.add_node(node)
    dropped.spin_once(timeout_sec=0)
    assert len(heard) == 2
    del dropped
    gc.collect()
    executor.add_node(node)
    executor.spin_once(timeout_sec=0)
    assert sorted(heard) == ["one", "three", "two"]


def test_a_coroutine_waits_for_its_node_to_come_back(node: Node, executor: SingleThreadedExecutor) -> None:
    calls = list[str]()

    async def steps() -> None:
        calls.append("first")
        await asyncio.sleep(0)
        calls.append("second")

    node.create_guard_condition(steps).trigger()
    executor.add_node(node)
    executor.spin_once(timeout_sec=0)
    executor.remove_node(node)
    executor.spin_once(timeout_sec=0)
    assert calls == ["first"]
    executor.add_node(node)
    executor.spin_once(timeout_sec=0)
    assert calls == ["first", "second"]


def test_an_executor_that_waits_sees_what_is_new(node: Node, executor: SingleThreadedExecutor) -> None:
    string = interface("std_msgs/msg/String")
    heard = list[str]()
    thread, raised = on_thread(executor.spin)
    wait_until(lambda: executor._asleep)
    executor.add_node(node)
    wait_until(lambda: executor._asleep)
    guard = node.create_guard_condition(lambda: heard.append("guard"))
    wait_until(lambda: executor._asleep)
    guard.trigger()
    wait_until(lambda: heard == ["guard"])
    node.create_timer(_DUE_S, lambda: heard.append("timer")).timer_period_ns = 10**15
    wait_until(lambda: heard == ["guard", "timer"])
    node.create_subscription(string, "new", lambda message: heard.append(message.data), 10)
    node.create_publisher(string, "new", 10).publish(string(data="message"))
    wait_until(lambda: heard[2:] == ["message"])
    task = executor.create_task(lambda: heard.append("task"))
    wait_until(task.done)
    executor.remove_node(node)
    guard.trigger()
    executor.shutdown()
    thread.join(5)
    assert heard[3:] == ["task"]
    assert raised == []


def test_entities_may_be_destroyed_in_callbacks(node: Node, executor: SingleThreadedExecutor) -> None:
    string = interface("std_msgs/msg/String")
    heard, done = list[str](), Future[None]()
    publisher = node.create_publisher(string, "gone", 10)

    def on_timer() -> None:
        node.destroy_timer(timer)
        publisher.publish(string(data="1"))
        publisher.publish(string(data="2"))

    def on_message(message: Any) -> None:
        heard.append(message.data)
        node.destroy_subscription(subscription)
        node.create_guard_condition(lambda: done.set_result(None)).trigger()

    executor.add_node(node)
    subscription = node.create_subscription(string, "gone", on_message, 10)
    timer = node.create_timer(_DUE_S, on_timer)
    executor.spin_until_future_complete(done, timeout_sec=5)
    assert done.done()
    assert heard == ["1"]


def test_nodes_of_two_contexts_have_two_executors(node: Node, executor: SingleThreadedExecutor) -> None:
    class Stranger:
        class handle:
            ingress = object()

    executor.add_node(node)
    with pytest.raises(UsageError, match="must share a context"):
        executor.add_node(Stranger())


# -- the end -----------------------------------------------------------------------------------------------------------


def test_shutdown_ends_a_spin_and_what_awaits(node: Node, executor: SingleThreadedExecutor) -> None:
    ended = list[str]()

    async def waits() -> None:
        try:
            await Future[None]()
        finally:
            ended.append("ended")

    executor.add_node(node)
    node.create_guard_condition(waits).trigger()
    thread, raised = on_thread(executor.spin)
    wait_until(lambda: executor._pending_tasks)
    wait_until(lambda: executor._asleep)
    assert executor.shutdown()
    thread.join(5)
    assert (raised, ended, executor.get_nodes(), thread.is_alive()) == ([], ["ended"], [], False)
    assert executor.shutdown()
    executor.spin()
    executor.spin_once()
    assert node.default_callback_group.can_execute(None)  # type: ignore[attr-defined]


def test_shutdown_waits_for_a_callback_as_long_as_it_may(node: Node, executor: SingleThreadedExecutor) -> None:
    running, may_end = threading.Event(), threading.Event()

    def slow() -> None:
        running.set()
        may_end.wait(5)

    executor.add_node(node)
    node.create_guard_condition(slow).trigger()
    thread, _ = on_thread(executor.spin)
    assert running.wait(5)
    assert not executor.shutdown(timeout_sec=0.01)
    threading.Timer(0.02, may_end.set).start()
    assert executor.shutdown()
    thread.join(5)


def test_a_callback_may_shut_its_executor_down(node: Node, executor: SingleThreadedExecutor) -> None:
    calls = list[bool]()
    executor.add_node(node)
    node.create_guard_condition(lambda: calls.append(executor.shutdown())).trigger()
    executor.spin()
    assert calls == [True]
    assert executor.get_nodes() == []


def test_the_end_of_the_context_ends_a_wait(ros2_router: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("METAROS_ZENOH_PORT", ros2_router)
    for kind in (SingleThreadedExecutor, MultiThreadedExecutor):
        context = Context()
        context.init([])
        executor = kind(context=context)
        if kind is SingleThreadedExecutor:
            executor.add_node(Node("ends", context=context, start_parameter_services=False, enable_rosout=False))
        thread, raised = on_thread(executor.spin)
        wait_until(lambda executor=executor: executor._asleep)  # type: ignore[misc]
        context.shutdown()
        thread.join(5)
        wanted = [ExternalShutdownException] if kind is SingleThreadedExecutor else []
        assert ([type(error) for error in raised], thread.is_alive()) == (wanted, False)
        executor.spin()  # over: nothing is run
        executor.shutdown()


def test_an_executor_is_let_go(rclpy_context: Context) -> None:
    gc.collect()
    wakers = len(rclpy_context._wakers)
    executor = SingleThreadedExecutor(context=rclpy_context)
    assert len(rclpy_context._wakers) == wakers + 1
    del executor
    gc.collect()
    assert len(rclpy_context._wakers) == wakers
