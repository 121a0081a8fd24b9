"""The asyncio executor: callbacks in the loop that runs already."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator

import pytest

from metaros.clock import SystemClock
from metaros.errors import ClosedError, UsageError
from metaros.executor import AsyncioExecutor, Ingress
from tests.support.nodes.small_node import Item, SmallNode
from tests.support.processes.threads import left_behind, threads_now
from tests.support.waiting import wait_until_async


@pytest.fixture
def node() -> Iterator[SmallNode]:
    opened = Ingress()
    yield SmallNode(opened, SystemClock())
    opened.close()


async def test_plain_and_async_callbacks_run_in_the_programs_loop(node):
    received: list[object] = []

    async def later(item: Item) -> None:
        await asyncio.sleep(0)
        received.append(asyncio.get_running_loop())

    node.listen("a", lambda item: received.append(threading.current_thread()))
    node.listen("b", later)
    ticked = asyncio.Event()
    node.timers.add(0.001, ticked.set)
    async with AsyncioExecutor(node):
        node.ingress.put(Item("a"))
        node.ingress.put(Item("b"))
        await wait_until_async(lambda: len(received) == 2)
        await asyncio.wait_for(ticked.wait(), 60)
    assert received == [threading.current_thread(), asyncio.get_running_loop()]
    node.ingress.put(Item("a"))
    await asyncio.sleep(0.01)
    assert len(received) == 2


async def test_leaving_the_block_cancels_what_awaits(node):
    before = threads_now()
    started, ended = asyncio.Event(), []

    async def forever(item: Item) -> None:
        started.set()
        try:
            await asyncio.sleep(1000)
        finally:
            ended.append("cancelled")

    node.listen("a", forever)
    async with AsyncioExecutor(node):
        node.ingress.put(Item("a"))
        await asyncio.wait_for(started.wait(), 60)
    assert ended == ["cancelled"]
    assert left_behind(before, "metaros-pump") == []


async def test_run_ends_with_its_nodes(node):
    executor = AsyncioExecutor(node)
    task = asyncio.create_task(executor.run())
    await asyncio.sleep(0.01)
    node.closed = True
    node.ingress.wake()
    await asyncio.wait_for(task, 60)
    with pytest.raises(ClosedError):
        await executor.run()


async def test_cancelling_run_cleans_up(node):
    executor = AsyncioExecutor(node)
    task = asyncio.create_task(executor.run())
    await asyncio.sleep(0.01)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    async with AsyncioExecutor(node):
        pass


async def test_a_node_of_another_executor_is_refused(node):
    async with AsyncioExecutor(node):
        with pytest.raises(UsageError, match="another executor"):
            await AsyncioExecutor(node).run()


async def test_callbacks_that_raise_end_nothing(node, caplog):
    async def fail(item: Item) -> None:
        raise RuntimeError("async no")

    node.listen("a", fail)
    node.timers.add(0.001, lambda: 1 / 0)
    async with AsyncioExecutor(node):
        node.ingress.put(Item("a"))
        await wait_until_async(lambda: "async no" in caplog.text and "ZeroDivisionError" in caplog.text)


def test_outside_a_loop_it_spins_like_any_other(node):
    executor = AsyncioExecutor(node)
    received: list[int] = []
    node.listen("a", lambda item: (received.append(item.value), executor.shutdown()))
    node.ingress.put(Item("a", 3))
    executor.spin()
    assert received == [3]
