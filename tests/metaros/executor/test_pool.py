"""The multi-threaded executor on small real nodes: what runs beside what."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from typing import Any

import pytest

from metaros.clock import SystemClock
from metaros.errors import UsageError
from metaros.executor import (
    Ingress,
    MultiThreadedExecutor,
    MutuallyExclusiveCallbackGroup,
    ReentrantCallbackGroup,
    SingleThreadedExecutor,
    pool,
)
from tests.support.nodes.small_node import Item, SmallNode
from tests.support.processes.threads import left_behind, threads_now
from tests.support.waiting import wait_until


@pytest.fixture
def node() -> Iterator[SmallNode]:
    opened = Ingress()
    yield SmallNode(opened, SystemClock())
    opened.close()


@pytest.fixture
def spinning(node: SmallNode) -> Iterator[MultiThreadedExecutor]:
    """An executor of three threads that spins the node in the background."""
    before = threads_now()
    executor = MultiThreadedExecutor(threads=3)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    yield executor
    executor.shutdown()
    thread.join(60)
    assert not thread.is_alive()
    assert left_behind(before, "metaros-worker") == []


class Gate:
    """A callback that holds its thread until it is opened, and knows how many are in it."""

    def __init__(self) -> None:
        self.open = threading.Event()
        self.inside = 0
        self.most = 0
        self.values: list[Any] = []
        self._lock = threading.Lock()

    def __call__(self, item: Item | None = None) -> None:
        with self._lock:
            self.inside += 1
            self.most = max(self.most, self.inside)
            if item is not None:
                self.values.append(item.value)
        self.open.wait(60)
        with self._lock:
            self.inside -= 1


def test_nodes_run_beside_each_other_a_nodes_own_callbacks_do_not(node, spinning):
    other = SmallNode(node.ingress, SystemClock())
    mine, its = Gate(), Gate()
    node.listen("a", mine)
    node.listen("b", mine)
    other.listen("a", its)
    spinning.add_node(other)
    for key in ("a", "b", "a", "b"):
        node.ingress.put(Item(key, key))
    wait_until(lambda: mine.inside == 1 and its.inside == 1)
    mine.open.set()
    its.open.set()
    wait_until(lambda: len(mine.values) == 4 and len(its.values) == 2)
    assert (mine.most, its.most) == (1, 1)


def test_groups_say_what_overlaps(node, spinning):
    one, two = Gate(), Gate()
    node.listen("a", one, group=MutuallyExclusiveCallbackGroup())
    node.listen("b", two, group=MutuallyExclusiveCallbackGroup())
    for number in range(5):
        node.ingress.put(Item("a", number))
        node.ingress.put(Item("b", number))
    wait_until(lambda: one.inside == 1 and two.inside == 1)
    one.open.set()
    two.open.set()
    wait_until(lambda: len(one.values) == 5 and len(two.values) == 5)
    assert (one.most, two.most) == (1, 1)
    assert one.values == two.values == list(range(5))


def test_reentrant_callbacks_overlap_with_themselves(node, spinning):
    gate = Gate()
    node.listen("a", gate, depth=100, group=ReentrantCallbackGroup())
    for number in range(20):
        node.ingress.put(Item("a", number))
    wait_until(lambda: gate.inside == 3)
    gate.open.set()
    wait_until(lambda: len(gate.values) == 20 and gate.inside == 0)
    assert gate.values[:3] == [0, 1, 2] or sorted(gate.values[:3]) == [0, 1, 2]


def test_many_items_each_come_once_and_in_order(node, spinning):
    received: dict[str, list[int]] = {"a": [], "b": []}
    node.listen("a", lambda item: received["a"].append(item.value), depth=None)
    node.listen("b", lambda item: received["b"].append(item.value), depth=None, group=MutuallyExclusiveCallbackGroup())
    for number in range(500):
        node.ingress.put(Item("a", number))
        node.ingress.put(Item("b", number))
    wait_until(lambda: all(len(got) == 500 for got in received.values()))
    assert received == {"a": list(range(500)), "b": list(range(500))}


def test_a_timer_goes_on_while_another_group_is_blocked(node, spinning):
    gate, ticks = Gate(), []
    node.listen("a", gate)
    node.timers.add(0.002, lambda: ticks.append(1), MutuallyExclusiveCallbackGroup())
    node.ingress.put(Item("a"))
    wait_until(lambda: gate.inside == 1)
    ticks.clear()
    wait_until(lambda: len(ticks) > 5)
    gate.open.set()


def test_a_timer_does_not_overlap_with_itself_unless_it_may(node, spinning):
    alone, together = Gate(), Gate()
    first = node.timers.add(0.002, alone)
    node.timers.add(0.002, together, ReentrantCallbackGroup())
    wait_until(lambda: together.inside == 2 and alone.inside == 1 and first.statistics.missed > 0)
    alone.open.set()
    together.open.set()
    wait_until(lambda: first.statistics.calls > 5)
    assert alone.most == 1


def test_async_callbacks_keep_their_group_until_they_are_done(node, spinning):
    log: list[str] = []
    gate, loops = asyncio.Event(), []

    async def slow(item: Item) -> None:
        loops.append(asyncio.get_running_loop())
        log.append(f"begin {item.value}")
        await gate.wait()
        log.append(f"end {item.value}")

    node.listen("slow", slow)
    node.listen("same", lambda item: log.append("same group"))
    node.listen("other", lambda item: log.append("other group"), group=MutuallyExclusiveCallbackGroup())
    for key, value in (("slow", 1), ("slow", 2)):
        node.ingress.put(Item(key, value))
    wait_until(lambda: "begin 1" in log, every_s=0.001)
    node.ingress.put(Item("same"))
    node.ingress.put(Item("other"))
    wait_until(lambda: "other group" in log)
    assert log == ["begin 1", "other group"]
    loops[0].call_soon_threadsafe(gate.set)
    wait_until(lambda: len(log) == 6)
    assert log.index("end 1") < log.index("same group")
    assert log.index("end 1") < log.index("begin 2") < log.index("end 2")


def test_async_callbacks_of_a_reentrant_group_overlap(node, spinning, monkeypatch):
    inside = most = done = 0
    gate, loops, counts = asyncio.Event(), [], []
    count = spinning._count

    def watched(owner: Any, step: int) -> None:
        count(owner, step)
        counts.append(owner.running)

    monkeypatch.setattr(spinning, "_count", watched)

    async def wait(item: Item) -> None:
        nonlocal inside, most, done
        loops.append(asyncio.get_running_loop())
        inside += 1
        most = max(most, inside)
        await gate.wait()
        inside -= 1
        done += 1

    box = node.listen("a", wait, depth=None, limit_bytes=100_000, group=ReentrantCallbackGroup())
    for number in range(200):
        node.ingress.put(Item("a", number))
    wait_until(lambda: inside == 64)
    loops[0].call_soon_threadsafe(gate.set)
    wait_until(lambda: done == 200 and (box.running, box.busy) == (0, False))
    assert most == 64
    assert max(counts) == 64, "none was counted twice: the mailbox would have looked full with a place free"


def test_callbacks_that_raise_end_nothing(node, spinning, caplog):
    received = threading.Event()

    def fail(item: Item) -> None:
        raise RuntimeError("no")

    async def fail_later(item: Item) -> None:
        raise RuntimeError("async no")

    node.listen("a", fail)
    node.listen("a", fail_later)
    node.listen("b", lambda item: received.set())
    node.timers.add(0.001, lambda: 1 / 0)
    for _ in range(5):
        node.ingress.put(Item("a"))
    wait_until(lambda: all(text in caplog.text for text in ("Error: no", "async no", "ZeroDivisionError")))
    node.ingress.put(Item("b"))
    assert received.wait(60)


def test_what_it_had_not_begun_goes_to_the_next_executor(node):
    gate, received = Gate(), []
    node.listen("a", gate)
    node.listen("b", lambda item: received.append(item.value))
    executor = MultiThreadedExecutor(threads=1)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    node.ingress.put(Item("a"))
    wait_until(lambda: gate.inside == 1)
    node.ingress.put(Item("b", 7))
    executor.shutdown()
    gate.open.set()
    thread.join(60)
    assert not thread.is_alive()
    following = SingleThreadedExecutor()
    following.add_node(node)
    wait_until(lambda: following.spin_once(0.01) or received)
    assert received == [7]
    following.shutdown()


def test_a_callback_that_blocks_for_ever_does_not_hold_up_the_end(node, monkeypatch):
    monkeypatch.setattr(pool, "_JOIN_S", 0.05)
    gate = Gate()
    node.listen("a", gate)
    executor = MultiThreadedExecutor(threads=2)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    node.ingress.put(Item("a"))
    wait_until(lambda: gate.inside == 1)
    executor.shutdown()
    thread.join(60)
    assert not thread.is_alive()
    gate.open.set()


def test_a_pool_needs_a_thread():
    with pytest.raises(UsageError, match="thread"):
        MultiThreadedExecutor(threads=0)
    assert MultiThreadedExecutor().threads >= 2


@pytest.mark.parametrize("group_class", [MutuallyExclusiveCallbackGroup, ReentrantCallbackGroup])
def test_what_a_worker_takes_after_the_stop_is_left_to_the_next_executor(node, group_class):
    received: list[int] = []
    box = node.listen("a", lambda item: received.append(item.value))
    first, group = MultiThreadedExecutor(threads=1), group_class()
    box.pending.append(Item("a", 1))
    box.queued = True  # it was taken off its ready queue
    first.shutdown()
    job = pool._Job(box, group)
    assert group.enter(job)
    first._jobs.put(job)
    first._jobs.put(None)
    first._labour()  # as one of its threads does
    assert (received, len(box.pending)) == ([], 1)
    assert group.enter(job)  # its place in the group is free again
    following = SingleThreadedExecutor()
    following.add_node(node)
    following.spin_once(0)
    assert received == [1]
    following.shutdown()
