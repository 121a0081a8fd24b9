"""The interface to the store for these features, called from their own threads.

Messages are merged, decoded and packed off the event loop, on threads; the store answers on its own. `StoreSource` is
the bridge: each question goes to the event loop, and the thread waits for its answer, no longer than `WAIT_S`.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
from collections.abc import Coroutine, Sequence
from typing import Any, Protocol, TypeVar

from gateway.errors import DamagedError, PurgedError, StoreError
from gateway.history.losses import MAX_LOSSES, Loss
from gateway.store import Store
from gateway.store.telemetry.history import TopicGap
from gateway.store.telemetry.samples import SampleFilter, StoredBatch, StoredRun
from gateway.store.telemetry.undated_gaps import undated_gaps

__all__ = ["WAIT_S", "Newest", "Source", "StoreSource", "loss_reason"]

Result = TypeVar("Result")
Newest = StoredBatch | DamagedError | PurgedError | None
WAIT_S = 60.0


class Source(Protocol):
    """Stored messages and losses. Every method may raise StoreError or ObjectStoreError."""

    def runs(self, robot_id: str, wanted: SampleFilter, *, newest_first: bool, limit: int) -> Sequence[StoredRun]:
        """Runs that hold anything wanted, of one moment: by lowest stamp, or by highest, descending."""

    def load(self, run: StoredRun) -> StoredBatch:
        """A run's samples; DamagedError or PurgedError when they cannot be had any more."""

    def newest(self, robot_id: str, topics: Sequence[str], t_ns: int) -> Sequence[Newest]:
        """Of each topic the run with its newest sample at or before `t_ns`, loaded; None where there is none."""

    def losses(self, robot_id: str, *, start_ns: int, end_ns: int) -> Sequence[Loss]:
        """The newest losses that touch the range."""


class StoreSource:
    """The gateway's store; used from any thread but that of the event loop."""

    def __init__(self, store: Store, loop: asyncio.AbstractEventLoop) -> None:
        self._store = store
        self._loop = loop

    def runs(self, robot_id: str, wanted: SampleFilter, *, newest_first: bool, limit: int) -> Sequence[StoredRun]:
        """As in Source."""
        return self._ask(self._store.runs(robot_id, wanted, limit=limit, newest_first=newest_first))

    def load(self, run: StoredRun) -> StoredBatch:
        """As in Source."""
        return self._ask(self._store.load(run))

    def newest(self, robot_id: str, topics: Sequence[str], t_ns: int) -> Sequence[Newest]:
        """As in Source."""

        async def one(topic: str) -> Newest:
            try:
                run = await self._store.newest(robot_id, topic, t_ns)
                return None if run is None else await self._store.load(run)
            except (DamagedError, PurgedError) as error:
                return error

        async def all_of_them() -> Sequence[Newest]:
            return await asyncio.gather(*map(one, topics))

        return self._ask(all_of_them())

    def losses(self, robot_id: str, *, start_ns: int, end_ns: int) -> Sequence[Loss]:
        """As in Source."""
        span = {"start_ns": start_ns, "end_ns": end_ns, "limit": MAX_LOSSES}
        found = self._ask(self._store.gaps_between(robot_id, **span))
        found += self._ask(self._store.read(lambda engine: undated_gaps(engine, robot_id, **span)))
        return [_loss(item) for item in found]

    def _ask(self, question: Coroutine[Any, Any, Result]) -> Result:
        try:
            future = asyncio.run_coroutine_threadsafe(question, self._loop)
        except RuntimeError:
            question.close()
            raise StoreError("the gateway is going down") from None
        try:
            return future.result(WAIT_S)
        except concurrent.futures.CancelledError:
            raise StoreError("the gateway is going down") from None
        except TimeoutError:
            future.cancel()
            raise StoreError(f"the store did not answer within {WAIT_S:.0f} s") from None


def loss_reason(error: DamagedError | PurgedError) -> str:
    """The reason under which what cannot be had any more is told."""
    return "purged" if isinstance(error, PurgedError) else "damaged"


def _loss(item: TopicGap) -> Loss:
    gap = item.gap
    return Loss(from_ns=gap.from_ns, to_ns=gap.to_ns, count=gap.count, reason=gap.reason, topic=item.topic or None)
