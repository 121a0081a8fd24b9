"""Deliveries in flight: leased by this gateway, with their handlers' calls and the room that they take."""

from __future__ import annotations

import asyncio
import logging
from collections import Counter
from collections.abc import Awaitable, Callable, Collection, Coroutine, Sequence
from typing import Any

from gateway.domain.automation.delivery import LOST, TOO_OLD, Dead, Delivery, Handler, Result, Retry, takes_batches
from metaros.clock import Clock
from metaros.limits import Limits

__all__ = ["FAILED", "TIMEOUT", "InFlight"]

log = logging.getLogger(__name__)

FAILED, TIMEOUT = "handler_failed", "timeout"
OnResult = Callable[[Handler | None, Delivery, Result], Awaitable[None]]


class InFlight:
    """`on_result` stores what came of a delivery; it is under way until that is done, and then `on_freed` is told."""

    def __init__(self, *, clock: Clock, limits: Limits, on_result: OnResult, on_freed: Callable[[], None]) -> None:
        self._clock = clock
        self._limits = limits
        self._on_result = on_result
        self._on_freed = on_freed
        self._deliveries: dict[str, Delivery] = {}
        self._of_target: Counter[tuple[str, str]] = Counter()
        self._starting: Counter[tuple[str, str]] = Counter()  # calls that their handler does not know of yet
        self._size_bytes = 0
        self._tasks: set[asyncio.Task[Any]] = set()

    def __len__(self) -> int:
        return len(self._deliveries)

    @property
    def ids(self) -> list[str]:
        """Whose leases are to be extended."""
        return list(self._deliveries)

    @property
    def free(self) -> int:
        """How many more may be under way."""
        return self._limits.deliveries_at_once - len(self._deliveries)

    @property
    def free_bytes(self) -> int:
        """The same, in bytes."""
        return self._limits.deliveries_at_once_bytes - self._size_bytes

    def count_of(self, kind: str, target: str) -> int:
        """How many of a target are under way."""
        return self._of_target[kind, target]

    def room(self, kind: str, handler: Handler) -> int:
        """How many deliveries of a kind a handler takes now; calls, where it takes batches."""
        return handler.room() - sum(number for (of, _), number in self._starting.items() if of == kind)

    def room_of(self, kind: str, handler: Handler, target: str) -> int:
        """The same of one of its targets, in deliveries."""
        calls = handler.room(target) - self._starting[kind, target]
        batch = handler.batch(target) if takes_batches(handler) else 1
        return min(calls * batch, max(batch, self._limits.deliveries_of_target) - self.count_of(kind, target))

    def start(self, handlers: dict[str, Handler], leased: Collection[Delivery]) -> None:
        """Deliver them, those of one target in batches where its handler likes that."""
        for delivery in leased:
            self._deliveries[delivery.id] = delivery
            self._of_target[delivery.put.kind, delivery.put.target] += 1
            self._size_bytes += len(delivery.put.payload)
        batches: dict[tuple[str, str], list[Delivery]] = {}
        for delivery in leased:
            handler = handlers.get(delivery.put.kind)
            refused = self._refused(delivery)
            if handler is None or refused is not None:
                self._spawn(self._finish(handler, [delivery], [refused or Dead(TOO_OLD)]))
            elif takes_batches(handler):
                batches.setdefault((delivery.put.kind, delivery.put.target), []).append(delivery)
            else:
                self._begin(handler, [delivery])
        for (kind, target), some in batches.items():
            handler = handlers[kind]
            assert takes_batches(handler)
            size = max(1, handler.batch(target))
            for first in range(0, len(some), size):
                self._begin(handler, some[first : first + size])

    async def empty(self, *, timeout_s: float) -> bool:
        """Wait until nothing is under way; False where something still is."""
        if self._tasks:
            await asyncio.wait(set(self._tasks), timeout=timeout_s)
        return not self._deliveries

    async def abort(self) -> None:
        """Break off every call."""
        for task in self._tasks:
            task.cancel()
        if self._tasks:
            await asyncio.wait(set(self._tasks), timeout=1.0)

    def _refused(self, delivery: Delivery) -> Dead | None:
        """Why it is not even tried."""
        if delivery.expires_ns <= self._clock.wall_ns():
            return Dead(TOO_OLD, delivery.message or "it was not delivered in time")
        if delivery.losses >= self._limits.delivery_losses:
            return Dead(LOST, f"{delivery.losses} times its gateway ended while it worked on it: delivery_losses")
        return None

    def _begin(self, handler: Handler, some: Sequence[Delivery]) -> None:
        self._starting[some[0].put.kind, some[0].put.target] += 1
        self._spawn(self._run_call(handler, some))

    async def _run_call(self, handler: Handler, some: Sequence[Delivery]) -> None:
        call = self._spawn(self._call(handler, some))
        try:
            done, _ = await asyncio.wait({call}, timeout=handler.timeout_s(some[0].put.target))
            if not done:
                results: Sequence[Result] = [Retry(TIMEOUT, "the handler took too long")] * len(some)
            elif call.cancelled():
                results = [Retry(FAILED, "the handler cancelled itself")] * len(some)
            else:
                results = call.result()
        except Exception as error:  # a mistake in one handler is that delivery's failure, nobody else's
            log.exception("delivering to %s failed in a way that nobody foresaw", some[0].put.target)
            results = [Retry(FAILED, f"{type(error).__name__}: {error}")] * len(some)
        finally:
            call.cancel()  # nobody waits for one that does not let itself be ended
        await self._finish(handler, some, results)

    async def _call(self, handler: Handler, some: Sequence[Delivery]) -> Sequence[Result]:
        key = (some[0].put.kind, some[0].put.target)
        self._starting[key] -= 1
        if not self._starting[key]:
            del self._starting[key]
        if not takes_batches(handler):
            return [await handler.deliver(some[0])]
        results = await handler.deliver_many(some)
        if len(results) != len(some):
            return [Retry(FAILED, f"{len(results)} results for {len(some)} deliveries")] * len(some)
        return results

    async def _finish(self, handler: Handler | None, some: Sequence[Delivery], results: Sequence[Result]) -> None:
        try:
            await asyncio.gather(
                *(self._on_result(handler, delivery, result) for delivery, result in zip(some, results, strict=True))
            )
        finally:
            for delivery in some:
                key = (delivery.put.kind, delivery.put.target)
                del self._deliveries[delivery.id]
                self._of_target[key] -= 1
                if not self._of_target[key]:
                    del self._of_target[key]
                self._size_bytes -= len(delivery.put.payload)
            self._on_freed()

    def _spawn(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task
