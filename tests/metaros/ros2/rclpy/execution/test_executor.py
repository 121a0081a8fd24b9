"""Spinning until something is so, and executors and groups of a program's own."""

from __future__ import annotations

import os
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import pytest

from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.callback_groups import CallbackGroup, ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.executors import (
    ConditionReachedException,
    Executor,
    MultiThreadedExecutor,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from metaros.ros2.rclpy.execution.inbox import Inbox
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rclpy.execution.wait_set import WaitSet
from metaros.ros2.rclpy.execution.waitable import NumberOfEntities, Waitable
from metaros.ros2.rosidl.catalogue import interface
from tests.support.nodes.threads import on_thread
from tests.support.waiting import wait_until

_DUE_S = 0.001


# -- until a future is done --------------------------------------------------------------------------------------------


def test_spin_until_future_complete(node: Node, executor: SingleThreadedExecutor) -> None:
    executor.add_node(node)
    ticks = 0

    def tick() -> None:
        nonlocal ticks
        ticks += 1

    node.create_timer(_DUE_S, tick)
    for timeout_sec in (0.02, 0):
        started_s = time.monotonic()
        executor.spin_until_future_complete(Future[None](), timeout_sec=timeout_sec)
        assert timeout_sec <= time.monotonic() - started_s < 1
    assert ticks > 2
    for timeout_sec in (5, None, -1):
        for end in (Future.cancel, lambda future: future.set_result(1)):
            future = Future[int]()
            thread = threading.Thread(target=end, args=(future,))
            thread.start()
            executor.spin_until_future_complete(future, timeout_sec=timeout_sec)
            assert future.done() or future.cancelled()
            thread.join()
    executor.spin_until_future_complete(future)  # it is done: nothing is run
    executor.spin_once_until_future_complete(future)


def test_many_turns_leave_one_waiter(node: Node, executor: SingleThreadedExecutor) -> None:
    executor.add_node(node)
    node.create_timer(0, lambda: None)
    future = Future[None]()
    executor.spin_until_future_complete(future, timeout_sec=0.01)
    assert len(future._waiters) == 1


def test_a_callback_may_spin_the_executor_itself(node: Node, executor: SingleThreadedExecutor) -> None:
    """As programs do that wait for a response inside of a callback; in another group, as in rclpy."""
    executor.add_node(node)
    future, calls = Future[None](), list[str]()

    def outer() -> None:
        inner.trigger()
        executor.spin_until_future_complete(future, timeout_sec=5)
        calls.append("outer")

    def inside() -> None:
        calls.append("inner")
        future.set_result(None)

    inner = node.create_guard_condition(inside, callback_group=ReentrantCallbackGroup())
    node.create_guard_condition(outer).trigger()
    executor.spin_once(timeout_sec=5)
    assert calls == ["inner", "outer"]


def test_two_threads_cannot_spin_it(node: Node, executor: SingleThreadedExecutor) -> None:
    executor.add_node(node)
    thread, _ = on_thread(executor.spin)
    wait_until(lambda: executor.is_spinning)
    with pytest.raises(RuntimeError, match="already spinning"):
        executor.spin_once(timeout_sec=0)
    executor.shutdown()
    thread.join(5)
    assert not thread.is_alive()


def test_ctrl_c_ends_a_spin_even_where_somebody_swallows_it(node: Node, executor: SingleThreadedExecutor) -> None:
    def swallows() -> None:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    executor.add_node(node)
    for end, wanted in ((swallows, 1), (lambda: signal.raise_signal(signal.SIGINT), 2)):
        node.create_guard_condition(end).trigger()
        with pytest.raises(KeyboardInterrupt):
            executor.spin()
        node.create_guard_condition(end).trigger()
        with pytest.raises(KeyboardInterrupt):
            executor.spin_until_future_complete(Future[None](), timeout_sec=5)
        assert len(list(node.guards)) == 2 * wanted
    interrupter = threading.Timer(0.01, os.kill, (os.getpid(), signal.SIGINT))
    interrupter.start()
    with pytest.raises(KeyboardInterrupt):
        executor.spin()
    interrupter.join()
    executor.spin_once(timeout_sec=0)  # all is in order


# -- executors and groups of a program's own ---------------------------------------------------------------------------


class Priority(Executor):
    """Important nodes on threads, the rest on one; as programs write it that know rclpy."""

    def __init__(self, context: Context) -> None:
        super().__init__(context=context)
        self.threads = ThreadPoolExecutor(2)
        self.taken: list[tuple[Any, Any]] = []

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """The one method that has to be defined."""
        try:
            handler, entity, node = self.wait_for_ready_callbacks(timeout_sec=timeout_sec)
        except (TimeoutException, ShutdownException):
            return
        self.taken.append((entity, node))
        self.threads.submit(handler)


def test_an_executor_of_ones_own(node: Node, rclpy_context: Context) -> None:
    string = interface("std_msgs/msg/String")
    heard, gate = list[str](), Future[None]()

    async def on_guard() -> None:
        heard.append("guard begins")
        await gate
        heard.append("guard ends")

    executor = Priority(rclpy_context)
    executor.add_node(node)
    group = ReentrantCallbackGroup()
    guard = node.create_guard_condition(on_guard, callback_group=group)
    subscription = node.create_subscription(string, "own", lambda message: heard.append(message.data), 10)
    inbox = Inbox(node.handle, heard.append, group, entity=guard)
    publisher = node.create_publisher(string, "own", 10)
    thread, raised = on_thread(executor.spin)
    for step in (
        guard.trigger,
        lambda: publisher.publish(string(data="1")),
        lambda: publisher.publish(string(data="2")),
        lambda: inbox.put("inbox"),
        lambda: executor.create_task(heard.append, "task"),
        lambda: gate.set_result(None),
    ):
        before = len(heard)
        step()
        wait_until(lambda before=before: len(heard) > before)  # type: ignore[misc]
    executor.shutdown()
    thread.join(5)
    executor.threads.shutdown()
    assert heard == ["guard begins", "1", "2", "inbox", "task", "guard ends"]
    assert executor.taken == [
        (guard, node),
        (subscription, node),
        (subscription, node),
        (guard, node),
        (None, None),
        (guard, node),
    ]
    assert raised == []


def test_how_waits_for_callbacks_end(node: Node, rclpy_context: Context) -> None:
    for kind in (SingleThreadedExecutor, MultiThreadedExecutor):
        executor = kind(context=rclpy_context)
        executor.add_node(node)
        with pytest.raises(TimeoutException):
            executor.wait_for_ready_callbacks(timeout_sec=0)
        with pytest.raises(ConditionReachedException):
            executor.wait_for_ready_callbacks(condition=lambda: True)
        generator = executor._wait_for_ready_callbacks()
        executor.shutdown()
        with pytest.raises(ShutdownException):
            next(generator)
        with pytest.raises(ShutdownException):
            executor.wait_for_ready_callbacks()
    with pytest.raises(NotImplementedError, match="defines spin_once"):
        Executor(context=rclpy_context).spin()


def test_a_handler_that_nobody_calls_gives_its_message_back(
    node: Node, executor: SingleThreadedExecutor, rclpy_context: Context
) -> None:
    string = interface("std_msgs/msg/String")
    heard = list[str]()
    node.create_subscription(string, "unused", lambda message: heard.append(message.data), 10)
    node.create_publisher(string, "unused", 10).publish(string(data="1"))
    with SingleThreadedExecutor(context=rclpy_context) as other:
        other.add_node(node)
        handler, _, _ = other.wait_for_ready_callbacks(timeout_sec=5)
        with pytest.raises(TimeoutException):
            other.wait_for_ready_callbacks(timeout_sec=0)
    handler()
    executor.add_node(node)
    executor.spin_once(timeout_sec=0)
    assert heard == ["1"]


def test_only_of_some_nodes(node: Node, executor: SingleThreadedExecutor, rclpy_context: Context) -> None:
    calls = list[str]()
    other = Node("other", context=rclpy_context, start_parameter_services=False, enable_rosout=False)
    for one, name in ((node, "node"), (other, "other")):
        executor.add_node(one)
        one.create_guard_condition(lambda name=name: calls.append(name)).trigger()  # type: ignore[misc]
    for chosen in (other, node):
        handler, _, owner = executor.wait_for_ready_callbacks(timeout_sec=0, nodes=[chosen])
        handler()
        assert owner is chosen
    assert calls == ["other", "node"]
    other.destroy_node()


class Asked(Waitable[None]):
    """Ready where `wanted` says so, of which nobody is told."""

    wanted = False

    def get_num_entities(self) -> NumberOfEntities:
        """None."""
        return NumberOfEntities()

    def add_to_wait_set(self, wait_set: WaitSet) -> None:
        """Nothing to be added."""

    def is_ready(self, wait_set: WaitSet) -> bool:
        """Once."""
        return self.wanted

    def take_data(self) -> None:
        """It is not ready again."""
        self.wanted = False

    async def execute(self, data: None) -> None:
        """Tell."""
        self.tell()

    def tell(self) -> None:
        """Set by the test."""


@pytest.mark.parametrize("what", ["guard", "timer", "native timer", "task", "waitable"])
def test_messages_one_after_another_keep_nothing_waiting(
    node: Node, executor: SingleThreadedExecutor, what: str
) -> None:
    string = interface("std_msgs/msg/String")
    executor.add_node(node)
    publisher = node.create_publisher(string, "chain", 10)
    heard, seen_at, ended = 0, list[int](), Future[None]()
    guard = node.create_guard_condition(lambda: seen_at.append(heard))
    asked = Asked(node.default_callback_group)
    asked.tell = lambda: seen_at.append(heard)  # type: ignore[method-assign]
    if what == "waitable":
        node.add_waitable(asked)

    def begin() -> None:
        if what == "guard":
            guard.trigger()
        elif what == "timer":
            node.create_timer(0.0, lambda: seen_at.append(heard))
        elif what == "native timer":
            node.handle.create_timer(1e-9, lambda: seen_at.append(heard))
        elif what == "task":
            executor.create_task(lambda: seen_at.append(heard))
        else:
            asked.wanted = True

    def hear(_: Any) -> None:
        nonlocal heard
        heard += 1
        if heard == 5:
            begin()
        if heard < 30:
            publisher.publish(string())
        else:
            ended.set_result(None)
            executor.wake()

    node.create_subscription(string, "chain", hear, 10)
    publisher.publish(string())
    thread = threading.Thread(target=executor.spin)
    thread.start()
    wait_until(ended.done)
    executor.shutdown()
    thread.join()
    assert seen_at, what
    assert seen_at[0] <= 7, (what, seen_at[:3])


class Bucket(CallbackGroup):
    """Lets a callback run for each token; knows its entities."""

    def __init__(self) -> None:
        super().__init__()
        self.tokens = 2
        self.begun: list[Any] = []

    def can_execute(self, entity: Any) -> bool:
        """Where there is a token."""
        return self.tokens > 0

    def beginning_execution(self, entity: Any) -> bool:
        """Take one."""
        self.tokens -= 1
        self.begun.append(entity)
        return True

    def ending_execution(self, entity: Any) -> None:
        """It is spent."""


def test_a_group_of_ones_own(node: Node, executor: SingleThreadedExecutor) -> None:
    string = interface("std_msgs/msg/String")
    heard, group = list[str](), Bucket()
    executor.add_node(node)
    subscription = node.create_subscription(
        string, "bucket", lambda message: heard.append(message.data), 10, callback_group=group
    )
    assert group.has_entity(subscription)
    publisher = node.create_publisher(string, "bucket", 10)
    for data in "abc":
        publisher.publish(string(data=data))
    executor.spin_until_future_complete(Future[None](), timeout_sec=0.01)
    assert heard == ["a", "b"]
    assert group.begun == [subscription] * 2
    refill = threading.Timer(0.01, setattr, (group, "tokens", 1))
    refill.start()  # nobody tells the executor: it asks such a group again now and then
    started_s = time.monotonic()
    executor.spin_once(timeout_sec=30)
    assert time.monotonic() - started_s < 15
    refill.join()
    assert heard == ["a", "b", "c"]
