"""The fair executor on small nodes: shares by a clock that only moves when told, and short real runs."""

from __future__ import annotations

import asyncio
import logging
import sys
import threading
import time
from typing import Any

import pytest

from metaros.clock import ManualClock, SystemClock
from metaros.errors import UsageError
from metaros.executor import FairExecutor, Ingress
from metaros.executor.fair_schedule import weight_of
from tests.support.nodes.small_node import Item, SmallNode
from tests.support.processes.threads import left_behind, threads_now
from tests.support.waiting import wait_until

LEVELS = (-5, 0, 5)


@pytest.fixture
def ingress():
    opened = Ingress()
    yield opened
    opened.close()


def simulated(clock: ManualClock) -> FairExecutor:
    """An executor that measures by the manual clock."""
    return FairExecutor(cpu_s=clock.monotonic_s, wall_s=clock.monotonic_s)


def busy_node(ingress: Ingress, clock: ManualClock, *, seconds: float = 0.001) -> SmallNode:
    """A node that computes as long as it is let."""
    node = SmallNode(ingress, clock)
    node.timers.add(seconds / 2, lambda: clock.advance(seconds))
    return node


def run_for(executor: FairExecutor, clock: ManualClock, seconds: float) -> None:
    end_s = clock.monotonic_s() + seconds
    while clock.monotonic_s() < end_s:
        executor.spin_once(0)


def test_busy_nodes_get_their_weights_part(ingress, clock):
    executor = simulated(clock)
    for nice in LEVELS:
        executor.add_node(busy_node(ingress, clock), nice=nice)
    clock.advance(0.001)
    run_for(executor, clock, 10.0)
    total = sum(map(weight_of, LEVELS))
    rows = executor.report()
    assert [row.nice for row in rows] == list(LEVELS)
    for row in rows:
        assert row.share == pytest.approx(row.weight / total, rel=0.05)
    assert sum(row.run_s for row in rows) == pytest.approx(10.0, rel=0.01)


def test_samples_count_like_timers(ingress, clock):
    executor = simulated(clock)
    nodes = [SmallNode(ingress, clock), SmallNode(ingress, clock)]
    for node, nice in zip(nodes, (-5, 0), strict=True):
        key = f"k{nice}"
        node.listen(key, lambda item, key=key: (clock.advance(0.001), ingress.put(Item(key))))
        ingress.put(Item(key))
        executor.add_node(node, nice=nice)
    run_for(executor, clock, 3.0)
    assert executor.report()[0].share == pytest.approx(3121 / (3121 + 1024), rel=0.05)


def test_a_late_sleeper_runs_at_once_and_catches_nothing_up(ingress, clock):
    executor = simulated(clock)
    late: list[float] = []
    sleeper = SmallNode(ingress, clock)
    sleeper.listen("late", lambda item: (clock.advance(0.001), late.append(clock.monotonic_s()), again()))

    def again() -> None:
        ingress.put(Item("late"))

    executor.add_node(busy_node(ingress, clock))
    executor.add_node(sleeper)
    clock.advance(0.001)
    run_for(executor, clock, 10.0)
    woken_s = clock.monotonic_s()
    again()
    run_for(executor, clock, 1.0)
    assert late[0] - woken_s <= 0.02 + 0.002  # within a period
    assert len(late) == pytest.approx(500, rel=0.08)


def test_a_node_has_its_nice_level_itself_unless_it_is_reported_another(ingress, clock):
    executor = simulated(clock)
    own, reported = busy_node(ingress, clock), busy_node(ingress, clock)
    own.nice = reported.nice = 7
    executor.add_node(own)
    executor.add_node(reported, nice=-3)
    executor.add_node(reported, nice=19)  # it is there already
    assert [row.nice for row in executor.report()] == [7, -3]
    executor.renice(own, 2)
    assert executor.report()[0].weight == weight_of(2)
    with pytest.raises(UsageError, match="nice"):
        executor.add_node(busy_node(ingress, clock), nice=20)


def test_a_timer_does_not_keep_its_own_nodes_samples_out(ingress, clock):
    executor = simulated(clock)
    node = busy_node(ingress, clock)
    received: list[Any] = []
    node.listen("a", lambda item: received.append(item.value))
    executor.add_node(node)
    clock.advance(0.001)
    ingress.put(Item("a", 1))
    run_for(executor, clock, 0.1)
    assert received == [1]


def test_callbacks_that_raise_are_logged_and_charged(ingress, clock, caplog):
    executor = simulated(clock)
    node = SmallNode(ingress, clock)

    def fail(item: Item) -> None:
        clock.advance(0.5)
        raise RuntimeError("no")

    node.listen("a", fail)
    executor.add_node(node)
    ingress.put(Item("a"))
    executor.spin_once(0)
    assert "RuntimeError: no" in caplog.text
    assert executor.report()[0].run_s == pytest.approx(0.5)


def test_who_blocks_is_charged_a_tenth_of_the_time_it_held_the_thread(ingress, clock):
    executor = FairExecutor(cpu_s=lambda: 0.0, wall_s=clock.monotonic_s)
    executor.add_node(busy_node(ingress, clock, seconds=1.0))
    clock.advance(0.5)
    executor.spin_once(0)
    assert executor.report()[0].run_s == pytest.approx(0.1)


def test_every_step_of_an_async_callback_is_charged(ingress):
    clock = ManualClock()
    executor = simulated(clock)
    node = SmallNode(ingress, SystemClock())
    done: list[str] = []

    async def work(item: Item) -> None:
        clock.advance(1.0)
        await asyncio.sleep(0.001)
        clock.advance(1.0)
        done.append("done")

    node.listen("a", work)
    executor.add_node(node)
    ingress.put(Item("a"))
    while not done:
        executor.spin_once(0.01)
    assert executor.report()[0].run_s == pytest.approx(2.0)
    executor.shutdown()


def test_shutdown_cancels_what_awaits(ingress):
    executor = FairExecutor()
    node = SmallNode(ingress, SystemClock())
    started, ended = threading.Event(), []

    async def forever(item: Item) -> None:
        started.set()
        try:
            await asyncio.sleep(1000)
        finally:
            ended.append("cancelled")

    node.listen("a", forever)
    executor.add_node(node)
    ingress.put(Item("a"))
    thread = threading.Thread(target=executor.spin)
    thread.start()
    assert started.wait(60)
    executor.shutdown()
    thread.join(60)
    assert not thread.is_alive()
    assert ended == ["cancelled"]


def burn(seconds: float) -> None:
    """CPU time of this thread."""
    end_s = time.thread_time() + seconds
    while time.thread_time() < end_s:
        pass


def test_real_callbacks_share_the_thread(ingress):
    executor = FairExecutor(period_s=0.01)
    for nice in LEVELS:
        node = SmallNode(ingress, SystemClock())
        node.timers.add(0.0001, lambda: burn(0.0005))
        executor.add_node(node, nice=nice)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    wait_until(lambda: sum(row.run_s for row in executor.report()) > 0.35)
    executor.shutdown()
    thread.join(60)
    total = sum(map(weight_of, LEVELS))
    for row in executor.report():
        assert row.share == pytest.approx(row.weight / total, rel=0.25)


def test_a_critical_node_runs_beside_a_blocked_callback(ingress, caplog):
    before = threads_now()
    executor = FairExecutor()
    blocker, critical = SmallNode(ingress, SystemClock()), SmallNode(ingress, SystemClock())
    blocked, leave = threading.Event(), threading.Event()
    ticks: list[str] = []
    received: list[Any] = []

    def block() -> None:
        blocked.set()
        leave.wait(60)

    blocker.timers.add(0.001, block)
    critical.timers.add(0.001, lambda: ticks.append(threading.current_thread().name))
    critical.listen("a", lambda item: received.append(item.value))
    executor.add_node(blocker)
    executor.add_node(critical, critical=True)
    assert executor.report()[1].realtime == "not started"
    with caplog.at_level(logging.WARNING):
        thread = threading.Thread(target=executor.spin)
        thread.start()
        assert blocked.wait(60)
        ticks.clear()
        ingress.put(Item("a", 5))
        wait_until(lambda: len(ticks) > 3 and received == [5])
    assert set(ticks) == {"metaros-critical"}
    assert sys.getswitchinterval() == pytest.approx(0.0001)
    row = executor.report()[1]
    assert row.critical
    assert row.realtime == "yes" or (row.realtime.startswith("no: ") and caplog.text.count("ordinary priority") == 1)
    leave.set()
    executor.shutdown()
    thread.join(60)
    assert not thread.is_alive()
    ticks.clear()
    assert left_behind(before, "metaros-critical") == []


def test_nodes_come_and_go_while_it_spins(ingress):
    executor = FairExecutor()
    first, second, third = (SmallNode(ingress, SystemClock()) for _ in range(3))
    ticks: list[str] = []
    for name, node in (("first", first), ("second", second), ("third", third)):
        node.timers.add(0.001, lambda name=name: ticks.append(name))
    executor.add_node(first)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    wait_until(lambda: "first" in ticks)
    executor.add_node(second)
    executor.add_node(third, critical=True)
    wait_until(lambda: {"second", "third"} <= set(ticks))
    executor.remove_node(first)
    executor.remove_node(third)
    ticks.clear()
    wait_until(lambda: ticks.count("second") > 5)
    assert set(ticks[1:]) == {"second"}
    second.closed = True
    ingress.wake()
    thread.join(60)
    assert not thread.is_alive()


def test_a_node_that_another_thread_removes_in_the_middle_of_its_turn_ends_only_itself(ingress, clock):
    leaving: list[SmallNode] = []

    def measure() -> float:
        """Another thread comes in between a callback and its charge."""
        if leaving:
            remover = threading.Thread(target=executor.remove_node, args=(leaving.pop(),))
            remover.start()
            remover.join(60)
        return clock.monotonic_s()

    executor = FairExecutor(cpu_s=measure, wall_s=clock.monotonic_s)
    first, second = busy_node(ingress, clock), busy_node(ingress, clock)
    first.timers.add(0.005, lambda: leaving.append(first))
    executor.add_node(first)
    executor.add_node(second)
    clock.advance(0.001)
    run_for(executor, clock, 0.1)
    (row,) = executor.report()
    assert (leaving, row.run_s) == ([], pytest.approx(0.1, rel=0.2))


def test_only_critical_nodes_are_fine_too(ingress):
    executor = FairExecutor()
    node = SmallNode(ingress, SystemClock())
    node.critical = True
    ticked = threading.Event()
    node.timers.add(0.001, ticked.set)
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    assert ticked.wait(60)
    executor.shutdown()
    thread.join(60)
    assert not thread.is_alive()
