"""The single-threaded executor, on small real nodes: an ingress, timers, a clock, and no network."""

from __future__ import annotations

import asyncio
import sys
import threading
from typing import Any

import pytest

from metaros.clock import ManualClock, SystemClock
from metaros.errors import ClosedError, UsageError
from metaros.executor import Ingress, SingleThreadedExecutor
from metaros.executor.switch_interval import shorten_switch_interval
from tests.support.nodes.small_node import Item, SmallNode
from tests.support.waiting import wait_until


@pytest.fixture
def ingress():
    opened = Ingress()
    yield opened
    opened.close()


@pytest.fixture
def node(ingress):
    return SmallNode(ingress, SystemClock())


@pytest.fixture
def executor(node):
    made = SingleThreadedExecutor()
    made.add_node(node)
    yield made
    made.shutdown()


def test_items_reach_every_listener_of_their_key_in_order(node, executor):
    first: list[int] = []
    second: list[int] = []
    node.listen("a", lambda item: first.append(item.value))
    node.listen("a", lambda item: second.append(item.value))
    node.listen("b", lambda item: first.append(-item.value))
    for number in (1, 2, 3):
        node.ingress.put(Item("a", number))
    node.ingress.put(Item("b", 4))
    node.ingress.put(Item("nobody"))
    while executor.spin_once(0):
        pass
    assert sorted(first) == [-4, 1, 2, 3]
    assert second == [1, 2, 3]
    assert node.ingress.unrouted == 1


def test_a_stop_together_with_a_message_ends_the_spin_and_leaves_the_message(node, executor, monkeypatch):
    got: list[int] = []
    node.listen("a", lambda item: got.append(item.value))
    wait = node.ingress.wait

    def wait_for_both(ready_queue, timeout_s):
        node.ingress.put(Item("a", 1))
        while not ready_queue.ready:
            wait(ready_queue, timeout_s)
        executor.shutdown()

    monkeypatch.setattr(node.ingress, "wait", wait_for_both)
    executor.spin()
    assert got == []


def test_spin_once_waits_only_as_long_as_reported(executor):
    assert executor.spin_once(0.01) is False


def test_a_callback_that_raises_does_not_end_the_spin(node, executor, caplog):
    def handle(item: Item) -> None:
        raise RuntimeError("no")

    node.listen("a", handle)
    node.timers.add(0.001, lambda: 1 / 0)
    node.ingress.put(Item("a"))
    wait_until(lambda: executor.spin_once(0.01) and all(word in caplog.text for word in ("ZeroDivision", "Error: no")))


def test_timers_follow_the_nodes_clock(ingress):
    clock = ManualClock()
    node = SmallNode(ingress, clock)
    calls: list[float] = []
    node.timers.add(10.0, lambda: calls.append(clock.monotonic_s()))
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    assert executor.spin_once(0) is False
    clock.advance(10)
    assert executor.spin_once(0) is True
    assert calls == [1010.0]


def test_backlogs_stay_bounded_while_a_callback_blocks(node, executor):
    entered, leave = threading.Event(), threading.Event()
    handled: list[int] = []

    def handle(item: Item) -> None:
        entered.set()
        leave.wait(60)
        handled.append(item.value)

    last = node.listen("last", handle, depth=3)
    all_ = node.listen("all", lambda item: handled.append(item.value), depth=None, limit_bytes=1000)
    thread = threading.Thread(target=executor.spin)
    node.ingress.put(Item("last", 0))
    thread.start()
    entered.wait(60)
    for number in range(1, 101):
        node.ingress.put(Item("last", number))
    for number in range(1000, 1100):
        node.ingress.put(Item("all", number))
    for number in range(2000, 2005):
        node.ingress.put(Item("all", number, size_bytes=300))
    wait_until(lambda: last.dropped == 97 and all_.dropped + len(all_.pending) == 105)
    assert sum(item.size_bytes for item in all_.pending) <= 1000
    kept = [item.value for item in all_.pending]
    assert kept == [2003, 2004] or kept == [2002, 2003, 2004]  # as the relief came once or several times
    leave.set()
    wait_until(lambda: len(handled) == 4 + len(kept))
    executor.shutdown()
    thread.join()
    assert handled[0] == 0
    assert sorted(handled[1:]) == [98, 99, 100, *kept]


def test_backlogs_stay_bounded_while_nobody_spins(node):
    box = node.listen("a", lambda item: None, depth=5)
    for number in range(1000):
        node.ingress.put(Item("a", number))
    wait_until(lambda: box.dropped == 995, timeout_s=60)


def test_async_callbacks_interleave_with_others_but_not_with_themselves(node, executor):
    log: list[str] = []
    gate = asyncio.Event()

    async def slow(item: Item) -> None:
        log.append(f"begin {item.value}")
        await gate.wait()
        log.append(f"end {item.value}")

    def quick(item: Item) -> None:
        log.append("quick")
        gate.set()

    node.listen("slow", slow)
    node.listen("quick", quick)
    node.ingress.put(Item("slow", 1))
    node.ingress.put(Item("slow", 2))
    node.ingress.put(Item("quick"))
    thread = threading.Thread(target=executor.spin)
    thread.start()
    wait_until(lambda: "end 2" in log)
    executor.shutdown()
    thread.join()
    assert log.index("quick") < log.index("end 1") < log.index("begin 2") < log.index("end 2")


def test_an_async_callback_that_raises_is_logged(node, executor, caplog):
    async def fail(item: Item) -> None:
        raise RuntimeError("async no")

    node.listen("a", fail)
    node.ingress.put(Item("a"))
    wait_until(lambda: "RuntimeError: async no" in caplog.text or (executor.spin_once(0.01) and False))


def test_shutdown_cancels_what_awaits(node, executor):
    started = threading.Event()
    ended: list[str] = []

    async def forever(item: Item) -> None:
        started.set()
        try:
            await asyncio.sleep(1000)
        finally:
            ended.append("cancelled")

    node.listen("a", forever)
    node.ingress.put(Item("a"))
    thread = threading.Thread(target=executor.spin)
    thread.start()
    started.wait(60)
    executor.shutdown()
    thread.join(60)
    assert not thread.is_alive()
    assert ended == ["cancelled"]


def test_spin_ends_when_its_nodes_are_closed(node, executor):
    thread = threading.Thread(target=executor.spin)
    thread.start()
    node.closed = True
    node.ingress.wake()
    thread.join(60)
    assert not thread.is_alive()


def test_only_the_executors_own_nodes_are_served(ingress, node, executor):
    other = SmallNode(ingress, SystemClock())
    received: list[str] = []
    node.listen("a", lambda item: received.append("node"))
    other.listen("a", lambda item: received.append("other"))
    ingress.put(Item("a"))
    executor.spin_once(0.1)
    executor.spin_once(0)
    assert received == ["node"]
    executor.add_node(other)
    executor.remove_node(node)
    executor.spin_once(0.1)
    assert received == ["node", "other"]


def test_misuse_is_named(node, executor):
    with pytest.raises(UsageError, match="no node"):
        SingleThreadedExecutor().spin_once(0)
    stranger = Ingress()
    with pytest.raises(UsageError, match="share a context"):
        executor.add_node(SmallNode(stranger, SystemClock()))
    stranger.close()
    second = SingleThreadedExecutor()
    second.add_node(node)
    refused: list[bool] = []

    def spin_in_spin() -> None:
        with pytest.raises(UsageError, match="another executor"):
            second.spin_once(0)
        refused.append(True)

    node.timers.add(0.001, spin_in_spin)
    wait_until(lambda: executor.spin_once(0.01) and bool(refused))
    second.shutdown()
    with pytest.raises(ClosedError):
        second.spin()


def test_spinning_shortens_the_switch_interval_unless_the_program_chose_its_own(executor):
    before_s = sys.getswitchinterval()
    try:
        sys.setswitchinterval(0.005)
        executor.spin_once(0)
        assert sys.getswitchinterval() == pytest.approx(0.0005)
        sys.setswitchinterval(0.02)
        executor.spin_once(0)
        assert sys.getswitchinterval() == pytest.approx(0.02)
        sys.setswitchinterval(0.005)
        shorten_switch_interval(0.0005, {"METAROS_SWITCH_INTERVAL": "off"})
        assert sys.getswitchinterval() == pytest.approx(0.005)
    finally:
        sys.setswitchinterval(before_s)


def test_executors_of_one_context_share_its_ingress(ingress, node, executor):
    other = SmallNode(ingress, SystemClock())
    second = SingleThreadedExecutor()
    second.add_node(other)
    received: dict[str, list[Any]] = {"node": [], "other": []}
    node.listen("a", lambda item: received["node"].append((item.value, threading.current_thread())))
    other.listen("a", lambda item: received["other"].append((item.value, threading.current_thread())))
    threads = [threading.Thread(target=each.spin) for each in (executor, second)]
    for thread in threads:
        thread.start()
    for number in range(200):
        ingress.put(Item("a", number))
        wait_until(lambda number=number: all(len(got) == number + 1 for got in received.values()), every_s=0.0005)
    executor.shutdown()
    second.shutdown()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    for name, thread in zip(("node", "other"), threads, strict=True):
        assert received[name] == [(number, thread) for number in range(200)]


def test_an_executor_hears_while_the_other_one_is_stuck(ingress, node, executor):
    other = SmallNode(ingress, SystemClock())
    second = SingleThreadedExecutor()
    second.add_node(other)
    stuck, leave, received = threading.Event(), threading.Event(), threading.Event()

    def block(item: Item) -> None:
        stuck.set()
        leave.wait(60)

    node.listen("block", block)
    other.listen("a", lambda item: received.set())
    threads = [threading.Thread(target=each.spin) for each in (executor, second)]
    for thread in threads:
        thread.start()
    ingress.put(Item("block"))
    assert stuck.wait(60)
    ingress.put(Item("a"))
    assert received.wait(60)
    leave.set()
    for each, thread in zip((executor, second), threads, strict=True):
        each.shutdown()
        thread.join(60)
        assert not thread.is_alive()


def test_a_timer_slower_than_its_period_leaves_room_for_others(ingress):
    clock = ManualClock()
    slow, quick = SmallNode(ingress, clock), SmallNode(ingress, clock)
    calls: list[str] = []
    slow.timers.add(0.1, lambda: (calls.append("slow"), clock.advance(0.3)))
    quick.timers.add(0.1, lambda: calls.append("quick"))
    executor = SingleThreadedExecutor()
    executor.add_node(slow)
    executor.add_node(quick)
    clock.advance(0.1)
    for _ in range(3):
        assert executor.spin_once(0) is True
    assert calls == ["slow", "quick"] * 3


def test_what_a_plain_callback_returns_does_not_matter(node, executor, caplog):
    node.listen("a", lambda item: (1, 2))
    node.ingress.put(Item("a"))
    assert executor.spin_once(1) is True
    executor.spin_once(0)
    assert caplog.text == ""
