"""Rates, simulated time and callback groups, on real nodes."""

from __future__ import annotations

import asyncio
import threading
import time

import pytest

import metaros
from metaros.clock import ManualClock
from metaros.errors import ClosedError, UsageError
from metaros.interfaces.builtin_interfaces.msg import Time
from metaros.interfaces.rosgraph_msgs.msg import Clock
from metaros.node import SimClock
from metaros.node.time.rate import Rate
from tests.support.waiting import wait_until


def test_a_rate_does_not_drift_and_counts_what_it_missed():
    clock = SimClock()
    clock.set_ns(1_000_000_000)
    rate = Rate(clock, 2.0)
    woken: list[bool] = []
    thread = threading.Thread(target=lambda: woken.append(rate.sleep()))
    thread.start()
    clock.set_ns(1_250_000_000)
    assert not woken
    clock.set_ns(1_625_000_000)  # 0.125 s late
    thread.join(60)
    assert woken == [True]
    clock.set_ns(3_750_000_000)  # due at 2.0; 2.5, 3.0 and 3.5 pass, too
    assert rate.sleep()
    assert rate.missed == 3
    thread = threading.Thread(target=lambda: woken.append(rate.sleep()))
    thread.start()
    clock.set_ns(4_000_000_000)
    thread.join(60)
    assert woken == [True, True]


def test_a_rate_starts_anew_when_time_goes_back():
    clock = SimClock()
    clock.set_ns(100_000_000_000)
    rate = Rate(clock, 1.0)
    done = threading.Event()
    thread = threading.Thread(target=lambda: (rate.sleep(), done.set()))
    thread.start()
    clock.set_ns(5_000_000_000)
    wait_until(lambda: rate._due_s == 6.0)
    clock.set_ns(6_000_000_000)
    assert done.wait(60)
    thread.join()


@pytest.mark.parametrize("hz", [0, -1, float("inf"), float("nan")])
def test_a_rate_that_makes_no_sense_is_refused(hz):
    with pytest.raises(UsageError, match="rate"):
        Rate(ManualClock(), hz)


async def test_rates_of_a_node_keep_time_and_end_with_it(here):
    node = metaros.Node("rated", context=here)
    rate = node.create_rate(100)
    begin_s = time.monotonic()
    for number in range(10):
        assert await rate.sleep_async() if number % 2 else rate.sleep()
    assert time.monotonic() - begin_s >= 0.095
    slow = node.create_rate(0.001)
    sleeper = asyncio.create_task(slow.sleep_async())
    blocked = asyncio.create_task(asyncio.to_thread(slow.sleep))
    await asyncio.sleep(0.02)
    node.close()
    assert await sleeper is False
    assert await blocked is False
    with pytest.raises(ClosedError):
        node.create_rate(1)


def at(seconds: float) -> Clock:
    """/clock's message."""
    whole, rest = divmod(round(seconds * 1e9), 1_000_000_000)
    return Clock(clock=Time(sec=whole, nanosec=rest))


def test_simulated_time_drives_the_nodes_clock_and_timers(here, there):
    source = metaros.Node("simulator", context=there)
    publisher = source.create_publisher(Clock, "/clock", metaros.QoSProfile(depth=1))
    node = metaros.Node("simulated", context=here, use_sim_time=True)
    calls: list[float] = []
    timer = node.create_timer(1.0, lambda: calls.append(node.clock.monotonic_s()))
    executor = metaros.SingleThreadedExecutor()
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()
    try:
        assert node.clock.wall_ns() == 0

        def show(seconds: float) -> None:
            wait_until(lambda: publisher.publish(at(seconds)) or node.clock.monotonic_s() == seconds)

        show(100.0)
        wait_until(lambda: timer.time_until_next_s() == 1.0)  # the first message is a jump, not a hundred missed calls
        assert calls == []
        show(101.5)
        wait_until(lambda: calls == [101.5])
        show(102.0)
        wait_until(lambda: calls == [101.5, 102.0])
        show(10.0)
        wait_until(lambda: timer.time_until_next_s() == 1.0)
        show(11.25)
        wait_until(lambda: calls == [101.5, 102.0, 11.25])
    finally:
        executor.shutdown()
        thread.join(60)
    assert not thread.is_alive()


def test_groups_reach_subscriptions_services_and_timers(here):
    from metaros.interfaces.example_interfaces.srv import AddTwoInts

    node = metaros.Node("grouped", context=here)
    executor = metaros.MultiThreadedExecutor(threads=3)
    executor.add_node(node)
    held, inside = threading.Event(), threading.Event()

    @node.timer(0.001, group=metaros.MutuallyExclusiveCallbackGroup())
    def hold() -> None:
        inside.set()
        held.wait(60)

    @node.service(AddTwoInts, "add", group=metaros.ReentrantCallbackGroup())
    def add(request: AddTwoInts.Request, response: AddTwoInts.Response) -> None:
        response.sum = request.a + request.b

    received = threading.Event()

    @node.subscription(Clock, "times", group=metaros.MutuallyExclusiveCallbackGroup())
    def listen(message: Clock) -> None:
        client = node.create_client(AddTwoInts, "add")  # a blocking call beside its own server: another thread answers
        assert client.call(AddTwoInts.Request(a=1, b=2)).sum == 3
        received.set()

    thread = threading.Thread(target=executor.spin)
    thread.start()
    assert inside.wait(60)
    publisher = node.create_publisher(Clock, "times")
    wait_until(lambda: publisher.events.matched)
    publisher.publish(at(1.0))  # once: the end would wait for a call that nobody answers any more
    assert received.wait(60)
    held.set()
    executor.shutdown()
    thread.join(60)
    assert not thread.is_alive()


def test_spin_takes_an_executor(here):
    nodes = [metaros.Node(name, context=here, nice=nice) for name, nice in (("one", -5), ("two", 5))]
    executor = metaros.FairExecutor()
    for node in nodes:
        node.create_timer(0.01, executor.shutdown)
    metaros.spin(nodes, executor=executor)
    assert [(row.name, row.nice) for row in executor.report()] == [("/one", -5), ("/two", 5)]
