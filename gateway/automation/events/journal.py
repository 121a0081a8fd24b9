"""The journal: events are queued, kept in order, and read by whoever goes on from a cursor.

Nobody is told an event that is not stored: what has a number was committed, here or at another gateway of the store.
Who watches reads on at his own pace, from the newest events in memory or from the store, so that a slow one costs
nothing. All methods on the event loop.
"""

from __future__ import annotations

import asyncio
import logging
from collections import Counter, deque
from collections.abc import AsyncGenerator, Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any, Protocol, TypeVar

import orjson

from gateway.automation.events.kinds import event_kind
from gateway.domain.automation.event import EVERYTHING, Event, EventFilter, EventPage
from gateway.errors import StoreError, TooManyError
from gateway.store.automation.events import add_events, event_bounds, newest_events, purge_events, read_events
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Database", "EventJournal", "Within"]

log = logging.getLogger(__name__)
Result = TypeVar("Result")
Within = Callable[[StoreEngine, Sequence[Event]], None]

BATCH = 512  # events of one commit, and of one look at the store
GATHER_S = 0.05  # for which events wait for others, so that a fleet that reconnects makes few commits
RETRY_S = 1.0
LOOK_S = 0.5  # at what other gateways appended, while somebody watches
PURGE_EVERY_S = 60.0
MAX_LOOKS = 16  # at the store, for one page of a filter that little matches


class Database(Protocol):
    """What is needed of the store."""

    @property
    def shared(self) -> bool:
        """Whether other gateways append to it."""

    @property
    def gateway_id(self) -> str:
        """Who appends here."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""


class EventJournal:
    """Emit, read, watch; `run` beside it stores what is emitted."""

    def __init__(
        self, database: Database, *, clock: Clock, limits: Limits = LIMITS, within: Within | None = None
    ) -> None:
        """`within` stores what follows from events in the very transaction that stores them, on the writer's thread."""
        self._database = database
        self._within = within
        self._clock = clock
        self._limits = limits
        self._waiting: deque[Event] = deque()
        self._dropped = 0
        self._commit: asyncio.Future[None] | None = None
        self._emitted = asyncio.Event()
        self._tail: deque[Event] = deque(maxlen=limits.events_in_memory)  # the newest, without a hole
        self._head = 0
        self._news = asyncio.Event()
        self._watchers = 0
        self._over = False
        self._seats: Counter[str] = Counter()

    @property
    def head(self) -> int:
        """The newest cursor that this gateway has seen."""
        return self._head

    @property
    def watchers(self) -> int:
        """How many follow it now."""
        return self._watchers

    @property
    def waiting(self) -> int:
        """How many events are not stored yet."""
        return len(self._waiting)

    def emit(self, kind: str, robot: str = "", data: Mapping[str, Any] | None = None) -> None:
        """Something happened. It is stored in a moment; where too much waits for the store it is counted as lost."""
        event_kind(kind)
        if len(self._waiting) >= self._limits.events_waiting:
            self._dropped += 1
            return
        text = orjson.dumps(dict(data or {}), option=orjson.OPT_NON_STR_KEYS)
        if len(text) > self._limits.event_bytes:
            text = orjson.dumps({"truncated": True, "size_bytes": len(text)})
        self._waiting.append(self._made(kind, robot, text.decode()))
        self._emitted.set()

    async def read(
        self, *, after: int | None, limit: int, wanted: EventFilter = EVERYTHING, before: int | None = None
    ) -> EventPage:
        """Events behind a cursor, the oldest first; without one the newest first, and `before` goes further back.

        A page may be short, or empty, where little of much matches: go on from its `next`. Raises StoreError.
        """
        if after is not None:
            return await self._forward(after, limit, wanted)
        return await self._backward(before, limit, wanted)

    async def watch(
        self, *, after: int | None = None, wanted: EventFilter = EVERYTHING
    ) -> AsyncGenerator[EventPage, None]:
        """Pages of what follows a cursor (None: what happens from now on), until `end`, or for ever: cancel it.

        Every page has events, or says how many are not kept any more. Raises StoreError when the store cannot be read.
        """
        self._watchers += 1
        try:
            cursor = after if after is not None else await self.newest()
            while not self._over:
                news = self._news  # from before the look: no event comes between
                page = await self._forward(cursor, BATCH, wanted)
                moved, cursor = page.next > cursor, page.next
                if page.events or page.lost:
                    yield page
                elif not moved:
                    await news.wait()
        finally:
            self._watchers -= 1

    async def newest(self) -> int:
        """The newest cursor of the store: where what happens from now on begins. Raises StoreError."""
        return (await self._read(event_bounds))[1]

    def enter(self, who: str) -> Callable[[], None]:
        """Take a place among those who watch; call what is returned to give it back.

        Raises:
            TooManyError: there is none left, of all or for `who`.
        """
        if self._seats.total() >= self._limits.event_streams:
            raise TooManyError(f"{self._limits.event_streams} follow the events already")
        if self._seats[who] >= self._limits.event_streams_each:
            raise TooManyError(f"you follow the events {self._limits.event_streams_each} times already")
        self._seats[who] += 1

        def leave() -> None:
            self._seats[who] -= 1
            if not self._seats[who]:
                del self._seats[who]

        return leave

    async def start(self) -> None:
        """Know where the journal stands."""
        self._head = await self.newest()

    async def run(self) -> None:
        """Store, look at what others appended, delete what is old; until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._store_all())
            group.create_task(self._purge_all())
            if self._database.shared:
                group.create_task(self._look_all())

    def end(self) -> None:
        """The gateway goes down: whoever watches is told to come back elsewhere, and later."""
        self._over = True
        self._news.set()

    async def close(self) -> None:
        """Store what waits, if the store takes it."""
        try:
            while self._waiting or self._dropped:
                await self.store_some()
        except StoreError as error:
            log.warning("the last %d events are not kept: %s", len(self._waiting), error)

    async def store_some(self) -> None:
        """One commit of what waits; StoreError leaves it waiting. A commit goes on where who asked for it is cancelled,
        and the next one begins behind it: else what was under way at the gateway's end would be stored twice.
        """
        if self._commit is None or self._commit.done():
            self._commit = asyncio.ensure_future(self._store_batch())
        await asyncio.shield(self._commit)

    async def _store_batch(self) -> None:
        lost, known = self._dropped, self._head
        some = list(islice(self._waiting, BATCH))
        entries = [*some, self._made("journal.lost", "", f'{{"count":{lost}}}')] if lost else some
        if not entries:
            return

        def job(engine: StoreEngine) -> list[Event]:
            last = add_events(engine, entries)
            if self._within is not None:
                first = last - len(entries) + 1
                self._within(engine, [replace(item, seq=seq) for seq, item in enumerate(entries, start=first)])
            return read_events(engine, after=max(known, last - BATCH - len(entries)), limit=2 * BATCH + 1)

        found = await self._database.run(job)
        for _ in some:
            self._waiting.popleft()
        self._dropped -= lost
        self._learn(found)

    async def refresh(self) -> None:
        """Learn what other gateways appended. Raises StoreError."""
        known = self._head

        def job(engine: StoreEngine) -> list[Event]:
            last = event_bounds(engine)[1]
            return read_events(engine, after=max(known, last - BATCH), limit=BATCH) if last > known else []

        self._learn(await self._read(job))

    def _learn(self, found: Sequence[Event]) -> None:
        fresh = [item for item in found if item.seq > self._head]
        if not fresh:
            return
        if fresh[0].seq != self._head + 1:
            self._tail.clear()
        self._tail.extend(fresh)
        self._head = fresh[-1].seq
        news, self._news = self._news, asyncio.Event()
        news.set()

    async def _forward(self, after: int, limit: int, wanted: EventFilter) -> EventPage:
        if self._tail and self._tail[0].seq - 1 <= after <= self._head:
            return _page(islice(self._tail, after + 1 - self._tail[0].seq, None), after, limit, wanted)

        def job(engine: StoreEngine) -> EventPage:
            first, last = event_bounds(engine)
            cursor, lost = min(max(after, first - 1), last), max(0, first - 1 - after)
            kept: list[Event] = []
            for _ in range(MAX_LOOKS):
                found = read_events(engine, after=cursor, robots=wanted.robots, limit=BATCH)
                page = _page(found, cursor, limit - len(kept), wanted)
                kept += page.events
                full = len(kept) >= limit
                cursor = page.next if full or len(found) == BATCH else last
                if full or len(found) < BATCH:
                    break
            return EventPage(events=tuple(kept), next=cursor, lost=lost)

        return await self._read(job)

    async def _backward(self, before: int | None, limit: int, wanted: EventFilter) -> EventPage:
        def job(engine: StoreEngine) -> EventPage:
            cursor, kept = before if before is not None else event_bounds(engine)[1] + 1, list[Event]()
            for _ in range(MAX_LOOKS):
                found = newest_events(engine, before=cursor, robots=wanted.robots, limit=BATCH)
                for item in found:
                    if len(kept) == limit:
                        return EventPage(events=tuple(kept), next=cursor)
                    cursor = item.seq
                    kept += [item] if wanted.matches(item) else []
                if len(found) < BATCH:
                    return EventPage(events=tuple(kept), next=0)
            return EventPage(events=tuple(kept), next=cursor)

        return await self._read(job)

    async def _store_all(self) -> None:
        while True:
            await self._emitted.wait()
            await asyncio.sleep(GATHER_S)
            self._emitted.clear()
            try:
                while self._waiting or self._dropped:
                    await self.store_some()
            except StoreError as error:
                log.debug("events wait for the store: %s", error)
                self._emitted.set()
                await asyncio.sleep(RETRY_S)

    async def _look_all(self) -> None:
        while True:
            await asyncio.sleep(LOOK_S)
            if self._watchers:
                try:
                    await self.refresh()
                except StoreError as error:
                    log.debug("events of other gateways cannot be read now: %s", error)

    async def _purge_all(self) -> None:
        while True:
            try:
                while await self.purge():
                    pass
            except StoreError as error:
                log.debug("old events wait for the store: %s", error)
            await asyncio.sleep(PURGE_EVERY_S)

    async def purge(self) -> int:
        """Delete some of what is too old or too much; how many went. Raises StoreError."""
        before_ns, most = self._clock.wall_ns() - round(self._limits.events_kept_s * 1e9), self._limits.events_kept
        if not await self._read(lambda engine: event_bounds(engine)[1]):
            return 0
        return await self._database.run(lambda engine: purge_events(engine, before_ns=before_ns, most=most))

    def _made(self, kind: str, robot: str, data: str) -> Event:
        return Event(
            seq=0, kind=kind, robot=robot, at_ns=self._clock.wall_ns(), gateway=self._database.gateway_id, data=data
        )

    async def _read(self, job: Callable[[StoreEngine], Result]) -> Result:
        def read(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._database.read(read)


def _page(found: Iterable[Event], after: int, limit: int, wanted: EventFilter) -> EventPage:
    """The first `limit` of some events that are wanted, and how far they were looked through."""
    kept: list[Event] = []
    cursor = after
    for item in found:
        if len(kept) == limit:
            break
        cursor = item.seq
        if wanted.matches(item):
            kept.append(item)
    return EventPage(events=tuple(kept), next=cursor)
