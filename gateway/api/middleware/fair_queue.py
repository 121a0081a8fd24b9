"""Fair queuing of anonymous requests by address: many of one address never keep another address waiting for long.

As long as few come, nobody waits. When more come than `per_s`, one is let in after the other, each time of the next
address in round-robin order. So whoever floods from a few addresses waits behind their own requests, and somebody who
wants to sign in meanwhile waits for one request of each of those addresses.
"""

from __future__ import annotations

import asyncio
from collections import OrderedDict, deque
from collections.abc import Callable

from gateway.errors import TooManyRequestsError

__all__ = ["FairQueue"]


class FairQueue:
    """Lives on the event loop. `free` takes a token for a request that need not wait; False where there is none."""

    def __init__(self, free: Callable[[], bool], *, per_s: float, most_each: int, most: int) -> None:
        """At most `most_each` requests of one address wait, and `most` of all; `per_s` 0: nobody ever waits."""
        self._free = free
        self._per_s = per_s
        self._most_each = most_each
        self._most = most
        self._queues: OrderedDict[str, deque[asyncio.Future[None]]] = OrderedDict()
        self._waiting = 0

    async def wait(self, address: str) -> None:
        """Until it is this request's turn; TooManyRequestsError where too many wait already."""
        if not self._per_s or (not self._queues and self._free()):
            return
        queue = self._queues.get(address)
        if self._waiting >= self._most or (queue is not None and len(queue) >= self._most_each):
            wait_s = max(1, len(queue or ())) * max(1, len(self._queues)) / self._per_s
            raise TooManyRequestsError("too many requests of who has not signed in: wait", retry_after_s=wait_s)
        waiter = asyncio.get_running_loop().create_future()
        if not self._queues:
            self._next_soon()
        self._queues.setdefault(address, deque()).append(waiter)
        self._waiting += 1
        await waiter

    def _next_soon(self) -> None:
        asyncio.get_running_loop().call_later(1.0 / self._per_s, self._next)

    def _next(self) -> None:
        """Let one in: of the address that has waited longest, which then goes to the end of the round."""
        while self._queues:
            address, queue = self._queues.popitem(last=False)
            waiter = queue.popleft()
            self._waiting -= 1
            if queue:
                self._queues[address] = queue
            if not waiter.done():  # who asked may have gone
                waiter.set_result(None)
                break
        if self._queues:
            self._next_soon()
