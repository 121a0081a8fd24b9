"""The manager of the queue: deliveries are accepted, handlers registered by kind, dead letters redriven or dropped."""

from __future__ import annotations

import asyncio
import functools
import random  # noqa: TID251 - the type only; the generator is an argument
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeVar

from gateway.automation.queue.accept import Acceptor
from gateway.automation.queue.database import Database, read_snapshot
from gateway.automation.queue.dispatcher import CLOSE_S, Dispatcher
from gateway.automation.queue.replay_runner import Match, PutAgain, ReplayRunner
from gateway.domain.automation.delivery import Backlog, DeadFilter, Delivery, Handler, Put, Totals
from gateway.domain.automation.gateway_event import Replay
from gateway.store.automation import dead_letters, deliveries
from gateway.store.automation.deliveries import Ready
from gateway.store.automation.queue_totals import totals
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["QueueManager", "QueueStatus"]

Result = TypeVar("Result")
PAGE = 500  # dead letters of one transaction


@dataclass(frozen=True, slots=True, kw_only=True)
class QueueStatus:
    """What the store holds, how many deliveries are under way here, and how tries here ended since the start."""

    totals: Totals
    under_way: int
    counts: Mapping[str, int] = field(default_factory=dict)


class QueueManager:
    """Give it its handlers, `start` it, let `run` run, `close` it. All on the event loop but for `notify`."""

    def __init__(self, database: Database, *, clock: Clock, rng: random.Random, limits: Limits = LIMITS) -> None:
        self._database = database
        self._clock = clock
        self._limits = limits
        self._loop: asyncio.AbstractEventLoop | None = None
        self.dispatcher = Dispatcher(database, clock=clock, rng=rng, limits=limits)
        self._acceptor = Acceptor(database, clock=clock, limits=limits, accepted=self._note)
        self._replays = ReplayRunner(database, clock=clock, limits=limits, notify=self.dispatcher.notify)

    def handle(self, kind: str, handler: Handler) -> None:
        """From now on this one delivers what is of that kind; what is of no handler's waits until it is too old."""
        self.dispatcher.handlers[kind] = handler

    async def start(self) -> None:
        """Take back what this gateway's former lives were working on. Raises StoreError."""
        self._loop = asyncio.get_running_loop()
        await self.dispatcher.start()

    async def run(self) -> None:
        """Until cancelled."""
        await self.dispatcher.run()

    async def close(self, *, timeout_s: float = CLOSE_S) -> None:
        """Accept what was asked, let what is under way come to its end for a while, and give the rest back."""
        await self._replays.close()
        await self._acceptor.close()
        await self.dispatcher.close(timeout_s=timeout_s)

    async def accept(self, puts: Sequence[Put]) -> list[str]:
        """Their ids, once they are durable: all of them are, or none. Of what is known by its target and `dedup` it is
        the first one's id.

        Raises:
            QueueFullError: too many wait already.
            TooLargeError: one of them is over its limit.
            StoreError: the store cannot now.
        """
        return await self._acceptor.accept(puts)

    def notify(self, puts: Sequence[Put]) -> None:
        """Somebody puts these in a transaction of the store's own, on its thread: deliver them when it is over."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._note, puts)

    def wake(self) -> None:
        """A handler has room again."""
        self.dispatcher.notify([])

    async def status(self) -> QueueStatus:
        """How it stands. Raises StoreError."""
        held = await read_snapshot(self._database, totals)
        return QueueStatus(totals=held, under_way=len(self.dispatcher.in_flight), counts=self.dispatcher.counts)

    async def backlog(self, kind: str, target: str) -> Backlog:
        """What one target has. Raises StoreError."""
        return await read_snapshot(self._database, lambda engine: deliveries.backlog(engine, kind, target))

    async def delivery(self, delivery_id: str) -> Delivery | None:
        """One delivery with its payload, in whatever state; None where it is not kept. Raises StoreError."""
        return await read_snapshot(self._database, lambda engine: deliveries.delivery(engine, delivery_id))

    async def dead_page(
        self, wanted: DeadFilter, *, before: tuple[int, str] | None = None, limit: int
    ) -> list[Delivery]:
        """Dead letters without their payloads, the newest first; `before` is the last one's `ended_ns` and id."""
        return await read_snapshot(
            self._database, lambda engine: dead_letters.dead_page(engine, wanted, before=before, limit=limit)
        )

    async def redrive(self, wanted: DeadFilter, *, most: int | None = None) -> int:
        """Deliver them again, the oldest first; how many.

        Raises:
            QueueFullError: there is no room for more; those before are under way.
        """
        gateway, limits = self._database.gateway_id, self._limits

        def some(before: DeadFilter, limit: int, engine: StoreEngine) -> int:
            now_ns = self._clock.wall_ns()
            moved = dead_letters.redrive(engine, before, gateway=gateway, now_ns=now_ns, limit=limit, limits=limits)
            self.notify([Put(kind=kind, target=target, payload=b"") for kind, target in dict.fromkeys(moved)])
            return len(moved)

        return await self._page_through(wanted, some, most)

    async def drop_dead(self, wanted: DeadFilter, *, most: int | None = None) -> int:
        """Delete them for good, the oldest first; how many. Raises StoreError."""

        def some(before: DeadFilter, limit: int, engine: StoreEngine) -> int:
            return dead_letters.drop_dead(engine, before, gateway=self._database.gateway_id, limit=limit)

        return await self._page_through(wanted, some, most)

    async def replay(self, replay: Replay, match: Match, put_again: PutAgain) -> Replay:
        """Deliver once more what happened in a span, as far as it matches: the replay as it stands.

        Under the same id it is the same replay: it goes on where it was, say after a restart, and puts nothing twice.

        Raises:
            TooManyError: too many replays go on.
        """
        return await self._replays.begin(replay, match, put_again)

    async def replays(self) -> list[Replay]:
        """Those that have not ended, then the others, the newest first. Raises StoreError."""
        return await self._replays.list()

    async def stop_replay(self, replay_id: str) -> bool:
        """End one as it is; False where it is over, or none. Raises StoreError."""
        return await self._replays.stop(replay_id)

    async def _page_through(
        self, wanted: DeadFilter, some: Callable[[DeadFilter, int, StoreEngine], int], most: int | None
    ) -> int:
        """Page by page, but none that dies meanwhile."""
        before = replace(wanted, to_ns=min(wanted.to_ns, self._clock.wall_ns() + 1))
        done = 0
        while most is None or done < most:
            limit = PAGE if most is None else min(PAGE, most - done)
            count = await self._database.run(functools.partial(some, before, limit))
            done += count
            if count < limit:
                break
        return done

    def _note(self, puts: Sequence[Put]) -> None:
        self.dispatcher.notify([Ready(one.kind, one.target, one.due_ns) for one in puts])
