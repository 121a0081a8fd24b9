"""The asyncio executor: callbacks run inside the event loop that the program has already."""

from __future__ import annotations

import asyncio
from typing import Any

from metaros.executor.protocol import Spinnable
from metaros.executor.single import SingleThreadedExecutor

__all__ = ["AsyncioExecutor"]


class AsyncioExecutor(SingleThreadedExecutor):
    """Runs callbacks, plain and `async def`, in the running loop; the program's own tasks go on beside them.

    `async with AsyncioExecutor(node): ...` runs them during the block, `await executor.run()` until `shutdown` or
    until the nodes are closed. A plain callback that blocks holds up the loop. Used once: made anew for another run.
    """

    def __init__(self, *nodes: Spinnable) -> None:
        super().__init__()
        self._task: asyncio.Task[None] | None = None
        for node in nodes:
            self.add_node(node)

    async def run(self) -> None:
        """Run callbacks until `shutdown`, until every node is closed, or until this is cancelled."""
        ingress = self._begin()
        self._loop = asyncio.get_running_loop()
        try:
            await self._turn_async(ingress, None, forever=True)
        finally:
            self._stopped.set()
            self._loop = None
            ingress.wake()
            if self._pump is not None:
                self._pump.join()  # it only waited for that wake
            self._end(ingress)
            await self._cancel_tasks()

    async def __aenter__(self) -> AsyncioExecutor:
        self._task = asyncio.create_task(self.run())
        await asyncio.sleep(0)
        return self

    async def __aexit__(self, *_: Any) -> None:
        self.shutdown()
        if self._task is not None:
            await self._task
