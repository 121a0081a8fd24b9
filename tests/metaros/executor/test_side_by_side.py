"""Executors of every kind on one ingress: each node's items come to it, all of them, in order."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

from metaros.clock import SystemClock
from metaros.executor import (
    AsyncioExecutor,
    FairExecutor,
    Ingress,
    MultiThreadedExecutor,
    SingleThreadedExecutor,
)
from tests.support.nodes.small_node import Item, SmallNode
from tests.support.waiting import wait_until

COUNT = 2000


def test_every_kind_of_executor_shares_an_ingress():
    ingress = Ingress()
    executors: list[Any] = [
        SingleThreadedExecutor(),
        MultiThreadedExecutor(threads=2),
        FairExecutor(),
        FairExecutor(),
        SingleThreadedExecutor(),
    ]
    received: list[list[int]] = []
    ticks = [0] * (len(executors) + 1)
    nodes = [SmallNode(ingress, SystemClock()) for _ in ticks]
    nodes[3].critical = True
    for number, node in enumerate(nodes):
        got: list[int] = []
        received.append(got)

        def plain(item: Item, got: list[int] = got) -> None:
            got.append(item.value)

        async def later(item: Item, got: list[int] = got) -> None:
            await asyncio.sleep(0)
            got.append(item.value)

        def tick(number: int = number) -> None:
            ticks[number] += 1

        node.listen("a", later if number == 4 else plain, depth=None, limit_bytes=1_000_000)
        node.timers.add(0.005, tick)
    for executor, node in zip(executors, nodes, strict=False):
        executor.add_node(node)
    in_loop = AsyncioExecutor(nodes[-1])
    threads = [threading.Thread(target=executor.spin) for executor in executors]
    threads.append(threading.Thread(target=lambda: asyncio.run(in_loop.run())))
    for thread in threads:
        thread.start()
    for number in range(COUNT):
        ingress.put(Item("a", number))
        if number % 100 == 0:
            threading.Event().wait(0.001)
    wait_until(lambda: all(len(got) == COUNT for got in received) and all(count > 3 for count in ticks))
    for executor in (*executors, in_loop):
        executor.shutdown()
    for thread in threads:
        thread.join(60)
        assert not thread.is_alive()
    ingress.close()
    assert received == [list(range(COUNT))] * len(nodes)
