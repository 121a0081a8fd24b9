"""The record of calls: what each came to, kept in the store in a moment, off the way of whoever called.

Every failure is kept, as far as the queue to the store has room; of calls that went well at most so many a second, as
a function that is called thousands of times a second has no history that anybody reads. All are counted.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter, deque
from collections.abc import Callable
from itertools import islice
from typing import Protocol, TypeVar

from gateway.automation.functions.meters import FunctionMeters
from gateway.domain.automation.invocation import OK, ROBOT, InvocationFilter, Recorded
from gateway.domain.fleet.command import new_command_id
from gateway.errors import StoreError
from gateway.store.automation import invocations as table
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Database", "Ledger"]

log = logging.getLogger(__name__)
Result = TypeVar("Result")

BATCH = 512  # calls of one commit
GATHER_S = 0.25  # for which calls wait for others
RETRY_S = 1.0
PURGE_EVERY_S = 60.0
LEARNT = 20_000  # calls of before the gateway began that its meters learn of


class Database(Protocol):
    """What is needed of the store."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""


class Ledger:
    """Add calls, let `run` store them, read pages."""

    def __init__(self, database: Database, meters: FunctionMeters, *, clock: Clock, limits: Limits = LIMITS) -> None:
        self._database = database
        self._meters = meters
        self._clock = clock
        self._limits = limits
        self._waiting: deque[Recorded] = deque()
        self._added = asyncio.Event()
        self._second = 0
        self._in_second: Counter[str] = Counter()
        self.skipped = 0  # calls that were counted and not kept

    def add(self, call: Recorded) -> None:
        """A call is over."""
        self._meters.count(call)
        full = len(self._waiting) >= self._limits.invocations_waiting
        if full or (call.status == OK and not self._has_turn(call.function)):
            self.skipped += 1
            return
        self._waiting.append(call)
        self._added.set()

    async def start(self) -> None:
        """Let the meters learn of the last hour. Raises StoreError."""
        since_ns = self._clock.wall_ns() - self._limits.function_minutes * 60 * 10**9

        def job(engine: StoreEngine) -> list[Recorded]:
            with engine.transaction(write=False):
                return table.newest_invocations(engine, since_ns=since_ns, limit=LEARNT)

        self._meters.learn([call for call in await self._database.read(job) if call.kind != ROBOT])

    async def run(self) -> None:
        """Store what is added and delete what is old; until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._store_all())
            group.create_task(self._purge_all())

    async def close(self) -> None:
        """Store what waits, if the store takes it."""
        try:
            while self._waiting:
                await self.store_some()
        except StoreError as error:
            log.warning("the last %d calls of functions are not kept: %s", len(self._waiting), error)

    async def page(self, wanted: InvocationFilter, *, limit: int, before: str = "") -> list[Recorded]:
        """The newest calls, newest first; those of the last moment may be missing. Raises StoreError."""

        def job(engine: StoreEngine) -> list[Recorded]:
            with engine.transaction(write=False):
                return table.list_invocations(engine, wanted, limit=limit, before=before)

        return await self._database.read(job)

    async def store_some(self) -> None:
        """One commit of what waits; StoreError leaves it waiting."""
        some = list(islice(self._waiting, BATCH))
        await self._database.run(lambda engine: table.add_invocations(engine, some))
        for _ in some:
            self._waiting.popleft()

    async def purge(self) -> int:
        """Delete some of what is too old or too much; how many went. Raises StoreError."""
        oldest_ns = max(0, self._clock.wall_ns() - round(self._limits.invocations_kept_s * 1e9))
        before = new_command_id(oldest_ns)[:10]  # the time's letters
        most = self._limits.invocations_kept
        return await self._database.run(lambda engine: table.purge_invocations(engine, before=before, most=most))

    def _has_turn(self, function: str) -> bool:
        """Whether another call of a function that went well is kept in this second."""
        second = int(self._clock.monotonic_s())
        if second != self._second:
            self._second = second
            self._in_second.clear()
        self._in_second[function] += 1
        return self._in_second[function] <= self._limits.invocations_per_s

    async def _store_all(self) -> None:
        while True:
            await self._added.wait()
            await asyncio.sleep(GATHER_S)
            self._added.clear()
            try:
                while self._waiting:
                    await self.store_some()
            except StoreError as error:
                log.debug("calls of functions wait for the store: %s", error)
                self._added.set()
                await asyncio.sleep(RETRY_S)

    async def _purge_all(self) -> None:
        while True:
            await asyncio.sleep(PURGE_EVERY_S)
            try:
                while await self.purge():
                    pass
            except StoreError as error:
                log.debug("old calls of functions wait for the store: %s", error)
