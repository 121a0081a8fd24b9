"""Events from outside: webhooks and what users put. What is accepted is stored, judged by the rules and in the
queue, in one transaction; those that come at the same time share it. All methods on the event loop.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field

from gateway.automation.rules.evaluator import RuleEngine
from gateway.automation.rules.registry import Database
from gateway.domain.automation.gateway_event import GatewayEvent
from gateway.errors import OverloadedError, StoreError
from gateway.store.automation.gateway_events import add_gateway_events
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["EventIntake"]

BATCH = 256  # of one transaction


@dataclass(slots=True)
class _Waiting:
    gateway_events: Sequence[GatewayEvent]
    done: asyncio.Future[int] = field(default_factory=lambda: asyncio.get_running_loop().create_future())


class EventIntake:
    """Accepts events; a transaction is under way, or nobody waits."""

    def __init__(self, database: Database, engine: RuleEngine, *, clock: Clock, limits: Limits = LIMITS) -> None:
        self._database = database
        self._engine = engine
        self._clock = clock
        self._limits = limits
        self._waiting: deque[_Waiting] = deque()
        self._count = 0
        self._task: asyncio.Task[None] | None = None

    async def accept(self, gateway_events: Sequence[GatewayEvent]) -> int:
        """Store and judge them; how many of them were new: what is known by source and id is accepted, once.

        Raises:
            OverloadedError: too many wait.
            TooLargeError: one is over its limit.
            StoreError: they cannot be stored now.
        """
        if self._count + len(gateway_events) > self._limits.happenings_waiting:
            raise OverloadedError(f"{self._count} events wait for their commit: come again in a moment")
        mine = _Waiting(gateway_events)
        self._waiting.append(mine)
        self._count += len(gateway_events)
        if self._task is None:
            self._task = asyncio.create_task(self._store_all())
        return await asyncio.shield(mine.done)

    async def close(self) -> None:
        """Return when what was accepted is stored."""
        if self._task is not None:
            await self._task

    async def _store_all(self) -> None:
        try:
            while self._waiting:
                await self._store_some()
        finally:
            self._task = None

    async def _store_some(self) -> None:
        some = [self._waiting.popleft()]
        size = len(some[0].gateway_events)
        while self._waiting and size + len(self._waiting[0].gateway_events) <= BATCH:
            some.append(self._waiting.popleft())
            size += len(some[-1].gateway_events)
        self._count -= size
        try:
            await self._store(some)
        except StoreError as error:
            for one in some:
                if not one.done.done():
                    one.done.set_exception(error)
        except Exception as error:  # of one of them: each by itself, so that the others do not fail with it
            for one in some:
                await self._alone(one, error if len(some) == 1 else None)

    async def _alone(self, one: _Waiting, error: Exception | None) -> None:
        try:
            if error is None:
                await self._store([one])
                return
        except Exception as found:  # whoever put it is told
            error = found
        if not one.done.done():
            one.done.set_exception(error)

    async def _store(self, some: Sequence[_Waiting]) -> None:
        now_ns, gateway = self._clock.wall_ns(), self._database.gateway_id

        def job(engine: StoreEngine) -> set[tuple[str, str]]:
            every = [gateway_event for one in some for gateway_event in one.gateway_events]
            new = add_gateway_events(engine, every, gateway=gateway, now_ns=now_ns)
            self._engine.on_gateway_events(engine, new, now_ns)
            return {(one.source, one.id) for one in new}

        new = await self._database.run(job)
        for one in some:
            mine = {(gateway_event.source, gateway_event.id) for gateway_event in one.gateway_events} & new
            new -= mine
            if not one.done.done():
                one.done.set_result(len(mine))
