"""Accepting deliveries: durable when `accept` returns, and as many callers as wait share one transaction."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from gateway.automation.queue.database import Database
from gateway.automation.queue.group_commit import GroupCommit
from gateway.domain.automation.delivery import Put
from gateway.domain.errors import QueueFullError
from gateway.errors import UnstorableError
from gateway.store.automation.deliveries import put
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.errors import TooLargeError
from metaros.limits import Limits

__all__ = ["Acceptor"]

TOGETHER = 256  # callers of one transaction
_Asked = Sequence[Put]


class Acceptor:
    """`accepted` is told, on the event loop, what was put."""

    def __init__(
        self, database: Database, *, clock: Clock, limits: Limits, accepted: Callable[[Sequence[Put]], None]
    ) -> None:
        self._database = database
        self._clock = clock
        self._limits = limits
        self._accepted = accepted
        self._group = GroupCommit[_Asked, list[str]](
            self._commit,
            size_bytes=lambda puts: sum(len(one.payload) for one in puts),
            most_items=TOGETHER,
            most_bytes=limits.delivery_batch_bytes,
        )

    async def accept(self, puts: Sequence[Put]) -> list[str]:
        """Their ids, once they are durable: all of them are, or none.

        Raises:
            QueueFullError: too many wait already, for their delivery or for the store.
            TooLargeError: one of them is over its limit.
            StoreError: the store cannot now.
        """
        if self._group.waiting >= self._limits.accepts_waiting:
            raise QueueFullError(f"{self._group.waiting} callers wait for the store already: accepts_waiting")
        if self._group.waiting_bytes > 4 * self._limits.delivery_batch_bytes:
            raise QueueFullError(f"{self._group.waiting_bytes} B wait for the store already: delivery_batch_bytes")
        ids = await self._group.submit(puts)
        self._accepted(puts)
        return ids

    async def close(self) -> None:
        """Wait for what was asked."""
        await self._group.close()

    async def _commit(self, asked: Sequence[_Asked]) -> list[list[str] | Exception]:
        try:
            return await self._database.run(lambda engine: self._put_all(engine, asked))
        except UnstorableError as error:
            if len(asked) == 1:
                return [error]
            # No database takes something of one of them: the others must not suffer from it.
            return [answer for one in asked for answer in await self._commit([one])]

    def _put_all(self, engine: StoreEngine, asked: Sequence[_Asked]) -> list[list[str] | Exception]:
        try:
            ids = iter(self._put(engine, [one for puts in asked for one in puts]))
        except (QueueFullError, TooLargeError) as error:
            if len(asked) == 1:
                return [error]
            return [answer for one in asked for answer in self._put_all(engine, [one])]
        return [[next(ids) for _ in puts] for puts in asked]

    def _put(self, engine: StoreEngine, puts: Sequence[Put]) -> list[str]:
        now_ns = self._clock.wall_ns()
        return put(engine, puts, gateway=self._database.gateway_id, now_ns=now_ns, limits=self._limits)
