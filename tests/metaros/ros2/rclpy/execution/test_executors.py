"""The single-threaded executor, on a real node; one context for all tests of the module."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any

import pytest

from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.callback_groups import ReentrantCallbackGroup
from metaros.ros2.rclpy.execution.executors import (
    SingleThreadedExecutor,
)
from metaros.ros2.rclpy.execution.inbox import Inbox
from metaros.ros2.rclpy.execution.task import Future
from metaros.ros2.rosidl.catalogue import interface
from tests.support.waiting import wait_until

_DUE_S = 0.001


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
