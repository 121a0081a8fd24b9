"""Takes what is due from the store as far as handlers have room, and sees to it that each delivery comes to an end.

It wakes when something was put here or is due, and looks through the store once a second for what others put. What it
has leased is its own until it is settled; should this process die, that is leased again by whoever comes first: its
next life at once, others once the lease ran out.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import random  # noqa: TID251 - the type only; the generator is an argument
from collections.abc import Awaitable, Callable, Sequence

from gateway.domain.command import new_command_id
from gateway.domain.delivery import Delivery, Handler, takes_batches
from gateway.errors import StoreError
from gateway.queue.agenda import Agenda
from gateway.queue.database import Database, look
from gateway.queue.flights import Flights
from gateway.queue.settling import Settling
from gateway.store import deliveries as table
from gateway.store.deliveries import Ready, Wish
from gateway.store.engine import StoreEngine
from gateway.store.queue_purge import purge_queue
from gateway.store.updates import take_duty
from metaros.clock import Clock
from metaros.limits import Limits

__all__ = ["Dispatcher"]

log = logging.getLogger(__name__)

POLL_S = 1.0
AGENDA = 10_000  # targets that are known without looking
SCAN = 2000  # targets of a kind that are looked at each time
TEND = 256  # overdue deliveries, and lost leases, of one transaction
PURGE_EVERY_S = 60.0
CLOSE_S = 5.0


class Dispatcher:
    """`start` it, let `run` run, `close` it. All on the event loop."""

    def __init__(self, database: Database, *, clock: Clock, rng: random.Random, limits: Limits) -> None:
        self.holder = f"{database.gateway_id}/{new_command_id(clock.wall_ns())}"
        self.handlers: dict[str, Handler] = {}
        self._database = database
        self._clock = clock
        self._limits = limits
        self._agenda = Agenda(most=AGENDA)
        self._scanned: dict[str, str] = {}  # how far each kind was looked through
        self._woken = asyncio.Event()
        self._settling = Settling(database, holder=self.holder, clock=clock, rng=rng, limits=limits, noted=self.noted)
        self.flights = Flights(clock=clock, limits=limits, landed=self._settling.settle, freed=self._woken.set)
        self._trouble = ""
        self._ending = False

    @property
    def counts(self) -> dict[str, int]:
        """How many tries ended how, by the state that followed, since the start."""
        return dict(self._settling.counts)

    async def start(self) -> None:
        """Take back what this gateway's former lives had leased. Raises StoreError."""
        names = {"gateway": self._database.gateway_id, "holder": self.holder}
        now_ns = self._clock.wall_ns()
        self.noted(await self._database.run(lambda engine: table.release(engine, **names, now_ns=now_ns)))

    def noted(self, rows: Sequence[Ready]) -> None:
        """Something was put, or is to be tried again, or there is room again."""
        self._agenda.note(rows)
        self._woken.set()

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._dispatch_all())
            tasks.create_task(self._every(POLL_S, self.look))
            tasks.create_task(self._every(POLL_S, self.tend))
            tasks.create_task(self._every(self._limits.delivery_lease_s / 4, self.extend))
            tasks.create_task(self._every(PURGE_EVERY_S, self.purge))

    async def close(self, *, timeout_s: float = CLOSE_S) -> None:
        """Let what is under way come to its end, for a while; give the rest back."""
        self._ending = True
        if not await self.flights.empty(timeout_s=timeout_s):
            await self.flights.abort()
        try:
            await self._database.run(lambda engine: table.hand_back(engine, holder=self.holder))
        except StoreError as error:
            log.warning("leases end by themselves in %g s: %s", self._limits.delivery_lease_s, error)

    async def step(self) -> int:
        """Lease what is due and there is room for, and begin to deliver it; how many. Raises StoreError."""
        now_ns = self._clock.wall_ns()
        wishes = self._wishes(now_ns)
        if not wishes:
            return 0
        try:
            leased, rest = await self._database.run(lambda engine: self._lease(engine, wishes, now_ns))
        except BaseException:
            self._agenda.note(Ready(wish.kind, wish.target, now_ns) for wish in wishes)
            raise
        self._agenda.note(rest)
        self.flights.start(self.handlers, leased)
        return len(leased)

    async def look(self) -> None:
        """Look through the store for targets that have something waiting. Raises StoreError."""
        for kind in list(self.handlers):
            after = self._scanned.get(kind, "")
            job = functools.partial(table.ready, kind=kind, after=after, limit=SCAN)
            rows = await look(self._database, job)
            self._scanned[kind] = rows[-1].target if len(rows) == SCAN else ""
            self.noted(rows)

    async def tend(self) -> None:
        """Give up what is too old, and let go of lost leases. Raises StoreError."""
        now_ns, for_ns = self._clock.wall_ns(), round(self._limits.delivery_lease_s * 1e9)
        most = min(TEND, self.flights.free)

        def job(engine: StoreEngine) -> tuple[list[Delivery], list[Ready]]:
            lost = table.reclaim(engine, now_ns=now_ns, limit=TEND)
            if most <= 0:
                return [], lost
            overdue = table.lease_overdue(engine, holder=self.holder, now_ns=now_ns, for_ns=for_ns, limit=most)
            return overdue, lost

        if not await look(self._database, lambda engine: table.needs_tending(engine, now_ns=now_ns)):
            return
        overdue, lost = await self._database.run(job)
        self.flights.start(self.handlers, overdue)
        if lost:
            log.warning("%d deliveries are leased anew: who had them is silent", len(lost))
            self.noted(lost)

    async def extend(self) -> None:
        """Keep the leases of what is under way. Raises StoreError."""
        until_ns = self._clock.wall_ns() + round(self._limits.delivery_lease_s * 1e9)
        if ids := self.flights.ids:
            await self._database.run(lambda engine: table.extend(engine, ids, holder=self.holder, until_ns=until_ns))

    async def purge(self) -> None:
        """Delete what is kept long enough; of several gateways one does. Raises StoreError."""
        gateway, now_ns = self._database.gateway_id, self._clock.wall_ns()

        def job(engine: StoreEngine) -> int:
            duty = take_duty(engine, "queue.purge", gateway, now_ns=now_ns, for_ns=round(2e9 * PURGE_EVERY_S))
            return purge_queue(engine, gateway=gateway, now_ns=now_ns, limits=self._limits) if duty else 0

        while await self._database.run(job):
            pass

    def _wishes(self, now_ns: int) -> list[Wish]:
        wishes: list[Wish] = []
        free = self.flights.free if self.flights.free_bytes > 0 else 0
        for kind, handler in self.handlers.items():
            try:
                some = self._wishes_of(kind, handler, free, now_ns)
            except Exception:  # one handler's mistake does not hold up the others
                log.exception("the handler of %s does not say how much room it has", kind)
                continue
            free -= sum(wish.most for wish in some)
            wishes += some
        return wishes

    def _wishes_of(self, kind: str, handler: Handler, free: int, now_ns: int) -> list[Wish]:
        room = self.flights.room(kind, handler)
        if takes_batches(handler) and room > 0:
            room = free  # of_target counts in batches
        of_target = functools.partial(self.flights.room_of, kind, handler)
        return self._agenda.wishes(kind, now_ns=now_ns, room=min(free, room), of_target=of_target)

    def _lease(self, engine: StoreEngine, wishes: Sequence[Wish], now_ns: int) -> tuple[list[Delivery], list[Ready]]:
        leased = table.lease(
            engine,
            wishes,
            holder=self.holder,
            now_ns=now_ns,
            for_ns=round(self._limits.delivery_lease_s * 1e9),
            most_bytes=min(self.flights.free_bytes, self._limits.delivery_batch_bytes),
        )
        return leased, table.due_of(engine, [(wish.kind, wish.target) for wish in wishes])

    async def _dispatch_all(self) -> None:
        while not self._ending:
            self._woken.clear()
            begun = 0
            try:
                begun = await self.step()
                self._trouble = ""
            except StoreError as error:
                self._complain(error)
            except Exception:  # what delivers everything outlives its mistakes
                log.exception("the queue failed in a way that nobody foresaw; it goes on")
            if not begun:
                await self._wait()

    async def _wait(self) -> None:
        """Until something is noted, or the next is due; a second at most."""
        now_ns = self._clock.wall_ns()
        next_ns = self._agenda.next_ns(now_ns)
        pause_s = POLL_S if next_ns is None else min((next_ns - now_ns) / 1e9, POLL_S)
        # What is due and finds no room waits until a delivery ends, or until its handler's room is asked again.
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(pause_s):
                await self._woken.wait()

    async def _every(self, pause_s: float, action: Callable[[], Awaitable[None]]) -> None:
        while not self._ending:
            try:
                await action()
            except StoreError as error:
                self._complain(error)
            except Exception:
                log.exception("the queue failed in a way that nobody foresaw; it goes on")
            await asyncio.sleep(pause_s)

    def _complain(self, error: StoreError) -> None:
        if str(error) != self._trouble:
            log.warning("the queue waits for the store: %s", error)
        self._trouble = str(error)
