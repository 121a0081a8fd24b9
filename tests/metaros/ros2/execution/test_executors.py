"""The single-threaded executor, on a real node; one context for all tests of the module."""

from __future__ import annotations

import asyncio
import gc
import os
import signal
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from typing import Any

import pytest

from metaros.errors import UsageError
from metaros.ros2.rclpy.core.context import Context
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.callback_groups import CallbackGroup, ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.executors import (
    ConditionReachedException,
    Executor,
    ExternalShutdownException,
    MultiThreadedExecutor,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
    await_or_execute,
)
from metaros.ros2.rclpy.execution.inbox import Inbox
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rosidl.catalogue import interface
from tests.support.waiting import wait_until

_DUE_S = 0.001


def _thread(run: Callable[[], object]) -> tuple[threading.Thread, list[BaseException]]:
    """Run it on a thread; what it raises."""
    raised: list[BaseException] = []

    def runs() -> None:
        try:
            run()
        except BaseException as error:
            raised.append(error)

    thread = threading.Thread(target=runs, daemon=True)
    thread.start()
    return thread, raised


# -- one callback ------------------------------------------------------------------------------------------------------


def test_spin_once_runs_one_callback_and_waits_for_it(node: Node, executor: SingleThreadedExecutor) -> None:
    calls = list[str]()
    executor.add_node(node)
    started_s = time.monotonic()
    executor.spin_once(timeout_sec=0)
    executor.spin_once(timeout_sec=0.01)
    assert 0.01 <= time.monotonic() - started_s < 1
    node.create_timer(_DUE_S, lambda: calls.append("timer"))
    executor.spin_once(timeout_sec=5)
    assert calls == ["timer"]


def test_every_kind_of_entity_has_its_turn_in_spin_once(node: Node, executor: SingleThreadedExecutor) -> None:
    calls = list[str]()
    executor.add_node(node)
    node.create_timer(0, lambda: calls.append("timer"))  # always due: it must not keep the others out
    guard = node.create_guard_condition(lambda: calls.append("guard"))
    string = interface("std_msgs/msg/String")
    node.create_subscription(string, "turns", lambda message: calls.append(message.data), 10)
    publisher = node.create_publisher(string, "turns", 10)
    executor.create_task(lambda: calls.append("task"))
    guard.trigger()
    for data in ("one", "two"):
        publisher.publish(string(data=data))
    for _ in range(8):
        executor.spin_once(timeout_sec=0)
    assert sorted(set(calls)) == ["guard", "one", "task", "timer", "two"]
    assert calls.index("one") < calls.index("two")
    assert len(calls) == 8


def test_coroutines_go_on_from_spin_to_spin(node: Node, executor: SingleThreadedExecutor) -> None:
    calls = list[str]()

    async def steps() -> None:
        calls.append("first")
        await asyncio.sleep(0)
        calls.append("second")

    executor.add_node(node)
    guard = node.create_guard_condition(steps)
    timer = node.create_timer(_DUE_S, steps)
    executor.spin_once(timeout_sec=5)
    assert calls == ["first"]
    timer.cancel()
    executor.spin_once(timeout_sec=0)
    assert calls == ["first", "second"]
    guard.trigger()
    executor.spin_once(timeout_sec=0)
    assert calls == ["first", "second", "first"]
    executor.spin_once(timeout_sec=1)
    assert calls == ["first", "second"] * 2


def test_a_callback_that_awaits_keeps_its_group(node: Node, executor: SingleThreadedExecutor) -> None:
    future, calls = Future[str](), list[Any]()

    async def waits() -> None:
        calls.append(await future)

    executor.add_node(node)
    first, second = node.create_guard_condition(waits), node.create_guard_condition(lambda: calls.append("second"))
    beside = node.create_guard_condition(lambda: calls.append("beside"), callback_group=ReentrantCallbackGroup())
    first.trigger()
    executor.spin_once(timeout_sec=0)
    for guard in (second, beside):
        guard.trigger()
    for _ in range(3):
        executor.spin_once(timeout_sec=0)
    assert calls == ["beside"]
    future.set_result("first")
    for _ in range(2):
        executor.spin_once(timeout_sec=0)
    assert calls == ["beside", "first", "second"]


def test_an_async_subscription_keeps_the_order_and_a_reentrant_one_overlaps(
    node: Node, executor: SingleThreadedExecutor
) -> None:
    string = interface("std_msgs/msg/String")
    gate, calls = Future[None](), list[str]()

    async def exclusive(message: Any) -> None:
        calls.append(f"exclusive {message.data} begins")
        await gate
        calls.append(f"exclusive {message.data} ends")

    async def reentrant(message: Any) -> None:
        calls.append(f"reentrant {message.data} begins")
        await gate

    executor.add_node(node)
    node.create_subscription(string, "order", exclusive, 10)
    node.create_subscription(string, "order", reentrant, 10, callback_group=ReentrantCallbackGroup())
    publisher = node.create_publisher(string, "order", 10)
    for data in ("1", "2"):
        publisher.publish(string(data=data))
    for _ in range(5):
        executor.spin_once(timeout_sec=0)
    assert sorted(calls) == ["exclusive 1 begins", "reentrant 1 begins", "reentrant 2 begins"]
    gate.set_result(None)
    for _ in range(5):
        executor.spin_once(timeout_sec=0)
    assert [call for call in calls if call.startswith("ex")] == [
        "exclusive 1 begins",
        "exclusive 1 ends",
        "exclusive 2 begins",
        "exclusive 2 ends",
    ]


def test_so_many_coroutines_of_a_reentrant_group_as_its_overlap_says(
    node: Node, executor: SingleThreadedExecutor
) -> None:
    gates, begun = [Future[None]() for _ in range(3)], list[int]()

    async def handle(number: int) -> None:
        begun.append(number)
        await gates[number]

    group = ReentrantCallbackGroup()
    group.overlap = 2
    inbox = Inbox(node.handle, handle, group)
    executor.add_node(node)
    for number in range(3):
        inbox.put(number)
    for _ in range(4):
        executor.spin_once(timeout_sec=0)
    assert begun == [0, 1]
    gates[1].set_result(None)
    for _ in range(2):
        executor.spin_once(timeout_sec=0)
    assert begun == [0, 1, 2]


def test_a_timer_that_becomes_due_goes_before_mail_that_waits(node: Node, executor: SingleThreadedExecutor) -> None:
    calls, timers = list[str](), list[Any]()

    def on_mail(name: str) -> None:
        calls.append(name)
        wait_until(lambda: timers[0].is_ready() or len(calls) > 1, every_s=0.001)
        if len(calls) == 3:
            executor.shutdown()

    def on_timer() -> None:
        calls.append("timer")
        timers[0].cancel()

    executor.add_node(node)
    for _ in range(2):
        Inbox(node.handle, on_mail, node.default_callback_group).put("mail")
    timers.append(node.create_timer(0.02, on_timer))
    executor.spin()
    assert calls == ["mail", "timer", "mail"]


def test_what_callbacks_raise_comes_out_of_the_spin(node: Node, executor: SingleThreadedExecutor) -> None:
    string = interface("std_msgs/msg/String")

    def fails(*_: Any) -> None:
        raise KeyError("lost")

    async def fails_later() -> None:
        await asyncio.sleep(0)
        raise KeyError("lost")

    executor.add_node(node)
    heard = list[str]()
    node.create_subscription(string, "fails", fails, 10)
    node.create_subscription(string, "fails", lambda message: heard.append(message.data), 10)
    guard = node.create_guard_condition(fails)
    publisher = node.create_publisher(string, "fails", 10)
    begin: dict[str, Callable[[], object]] = {
        "guard": guard.trigger,
        "message": lambda: publisher.publish(string(data="x")),
        "task": lambda: executor.create_task(fails),
        "coroutine": lambda: executor.create_task(fails_later),
    }
    for name, start in begin.items():
        start()
        with pytest.raises(KeyError, match="lost"):
            executor.spin()
        assert not executor.is_spinning, name
    executor.spin_once(timeout_sec=0)
    assert heard == ["x"]  # the one after that which failed was not lost


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
    thread, raised = _thread(executor.spin)
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
    thread, _ = _thread(executor.spin)
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
    thread, raised = _thread(executor.spin)
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
    thread, _ = _thread(executor.spin)
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
        thread, raised = _thread(executor.spin)
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
    thread, raised = _thread(executor.spin)
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
    executor.spin_once(timeout_sec=5)
    refill.join()
    assert heard == ["a", "b", "c"]
