"""Inboxes."""

from __future__ import annotations

import threading
from typing import Any

import pytest

from metaros.limits import LIMITS
from metaros.ros2.rclpy.core.node import Node
from metaros.ros2.rclpy.execution.executors import SingleThreadedExecutor
from metaros.ros2.rclpy.execution.inbox import Inbox
from metaros.ros2.rclpy.execution.task import Future


def test_items_of_other_threads_are_handled_in_order_by_the_executor(
    node: Node, executor: SingleThreadedExecutor
) -> None:
    heard, done = list[Any](), Future[None]()

    def handle(item: int | None) -> None:
        heard.append((item, threading.get_ident()))
        if item is None:
            done.set_result(None)

    inbox = Inbox(node.handle, handle, node.default_callback_group)

    def put() -> None:
        for item in (*range(1000), None):
            inbox.put(item)

    threading.Thread(target=put).start()
    executor.add_node(node)
    executor.spin_until_future_complete(done, timeout_sec=5)
    assert [item for item, _ in heard] == [*range(1000), None]
    assert {thread for _, thread in heard} == {threading.get_ident()}
    assert inbox.dropped == 0


def test_it_is_bounded_forgets_when_closed_and_raises(node: Node, executor: SingleThreadedExecutor) -> None:
    heard = list[Any]()
    executor.add_node(node)
    inbox = Inbox(node.handle, heard.append, size_of=lambda item: LIMITS.ingress_bytes // 2)
    for item in range(10):
        inbox.put(item)
    executor.spin_once(timeout_sec=5)
    assert heard[0] == inbox.dropped > 0
    inbox.close()
    executor.spin_once(timeout_sec=0)
    assert len(heard) == 1
    failing = Inbox(node.handle, lambda item: item / 0)
    failing.put(1)
    with pytest.raises(ZeroDivisionError):
        executor.spin_once(timeout_sec=5)
