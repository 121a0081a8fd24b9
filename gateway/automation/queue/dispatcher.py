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

from gateway.automation.queue.database import Database, read_snapshot
from gateway.automation.queue.due_targets import DueTargets
from gateway.automation.queue.in_flight import InFlight
from gateway.automation.queue.result_writer import ResultWriter
from gateway.domain.automation.delivery import Delivery, Handler, takes_batches
from gateway.domain.fleet.command import new_command_id
from gateway.errors import StoreError
from gateway.store.automation import deliveries as table
from gateway.store.automation.deliveries import LeaseRequest, Ready
from gateway.store.automation.queue_purge import purge_queue
from gateway.store.engine import StoreEngine
from gateway.store.fleet.updates import take_duty
from metaros.clock import Clock
from metaros.limits import Limits

__all__ = ["Dispatcher"]

log = logging.getLogger(__name__)

POLL_S = 1.0
MAX_DUE_TARGETS = 10_000  # targets that are known without looking
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
        self._due_targets = DueTargets(most=MAX_DUE_TARGETS)
        self._scanned: dict[str, str] = {}  # how far each kind was looked through
        self._woken = asyncio.Event()
        self._results = ResultWriter(
            database, holder=self.holder, clock=clock, rng=rng, limits=limits, notify=self.notify
        )
        self.in_flight = InFlight(clock=clock, limits=limits, on_result=self._results.settle, on_freed=self._woken.set)
        self._trouble = ""
        self._ending = False

    @property
    def counts(self) -> dict[str, int]:
        """How many tries ended how, by the state that followed, since the start."""
        return dict(self._results.counts)

    async def start(self) -> None:
        """Take back what this gateway's former lives had leased. Raises StoreError."""
        names = {"gateway": self._database.gateway_id, "holder": self.holder}
        now_ns = self._clock.wall_ns()
        self.notify(await self._database.run(lambda engine: table.release(engine, **names, now_ns=now_ns)))

    def notify(self, rows: Sequence[Ready]) -> None:
        """Something was put, or is to be tried again, or there is room again."""
        self._due_targets.note(rows)
        self._woken.set()

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._dispatch_all())
            tasks.create_task(self._every(POLL_S, self.scan))
            tasks.create_task(self._every(POLL_S, self.expire))
            tasks.create_task(self._every(self._limits.delivery_lease_s / 4, self.extend))
            tasks.create_task(self._every(PURGE_EVERY_S, self.purge))

    async def close(self, *, timeout_s: float = CLOSE_S) -> None:
        """Let what is under way come to its end, for a while; give the rest back."""
        self._ending = True
        if not await self.in_flight.empty(timeout_s=timeout_s):
            await self.in_flight.abort()
        try:
            await self._database.run(lambda engine: table.hand_back(engine, holder=self.holder))
        except StoreError as error:
            log.warning("leases end by themselves in %g s: %s", self._limits.delivery_lease_s, error)

    async def step(self) -> int:
        """Lease what is due and there is room for, and begin to deliver it; how many. Raises StoreError."""
        now_ns = self._clock.wall_ns()
        lease_requests = self._wishes(now_ns)
        if not lease_requests:
            return 0
        try:
            leased, rest = await self._database.run(lambda engine: self._lease(engine, lease_requests, now_ns))
        except BaseException:
            self._due_targets.note(Ready(request.kind, request.target, now_ns) for request in lease_requests)
            raise
        self._due_targets.note(rest)
        self.in_flight.start(self.handlers, leased)
        return len(leased)

    async def scan(self) -> None:
        """Look through the store for targets that have something waiting. Raises StoreError."""
        wanted = {kind: self._scanned.get(kind, "") for kind in self.handlers}

        def job(engine: StoreEngine) -> dict[str, list[Ready]]:
            return {kind: table.ready(engine, kind=kind, after=after, limit=SCAN) for kind, after in wanted.items()}

        for kind, rows in (await read_snapshot(self._database, job)).items():
            self._scanned[kind] = rows[-1].target if len(rows) == SCAN else ""
            self.notify(rows)

    async def expire(self) -> None:
        """Give up what is too old, and let go of lost leases. Raises StoreError."""
        now_ns, for_ns = self._clock.wall_ns(), round(self._limits.delivery_lease_s * 1e9)
        most = min(TEND, self.in_flight.free)

        def job(engine: StoreEngine) -> tuple[list[Delivery], list[Ready]]:
            lost = table.reclaim(engine, now_ns=now_ns, limit=TEND)
            if most <= 0:
                return [], lost
            overdue = table.lease_overdue(engine, holder=self.holder, now_ns=now_ns, for_ns=for_ns, limit=most)
            return overdue, lost

        if not await read_snapshot(self._database, lambda engine: table.needs_tending(engine, now_ns=now_ns)):
            return
        overdue, lost = await self._database.run(job)
        self.in_flight.start(self.handlers, overdue)
        if lost:
            log.warning("%d deliveries are leased anew: who had them is silent", len(lost))
            self.notify(lost)

    async def extend(self) -> None:
        """Keep the leases of what is under way. Raises StoreError."""
        until_ns = self._clock.wall_ns() + round(self._limits.delivery_lease_s * 1e9)
        if ids := self.in_flight.ids:
            await self._database.run(lambda engine: table.extend(engine, ids, holder=self.holder, until_ns=until_ns))

    async def purge(self) -> None:
        """Delete what is kept long enough; of several gateways one does. Raises StoreError."""
        gateway, now_ns = self._database.gateway_id, self._clock.wall_ns()

        def job(engine: StoreEngine) -> int:
            duty = take_duty(engine, "queue.purge", gateway, now_ns=now_ns, for_ns=round(2e9 * PURGE_EVERY_S))
            return purge_queue(engine, gateway=gateway, now_ns=now_ns, limits=self._limits) if duty else 0

        while await self._database.run(job):
            pass

    def _wishes(self, now_ns: int) -> list[LeaseRequest]:
        lease_requests: list[LeaseRequest] = []
        free = self.in_flight.free if self.in_flight.free_bytes > 0 else 0
        for kind, handler in self.handlers.items():
            try:
                some = self._wishes_of(kind, handler, free, now_ns)
            except Exception:  # one handler's mistake does not hold up the others
                log.exception("the handler of %s does not say how much room it has", kind)
                continue
            free -= sum(request.most for request in some)
            lease_requests += some
        return lease_requests

    def _wishes_of(self, kind: str, handler: Handler, free: int, now_ns: int) -> list[LeaseRequest]:
        room = self.in_flight.room(kind, handler)
        if takes_batches(handler) and room > 0:
            room = free  # of_target counts in batches
        of_target = functools.partial(self.in_flight.room_of, kind, handler)
        return self._due_targets.lease_requests(kind, now_ns=now_ns, room=min(free, room), of_target=of_target)

    def _lease(
        self, engine: StoreEngine, lease_requests: Sequence[LeaseRequest], now_ns: int
    ) -> tuple[list[Delivery], list[Ready]]:
        leased = table.lease(
            engine,
            lease_requests,
            holder=self.holder,
            now_ns=now_ns,
            for_ns=round(self._limits.delivery_lease_s * 1e9),
            most_bytes=min(self.in_flight.free_bytes, self._limits.delivery_batch_bytes),
        )
        return leased, table.due_of(engine, [(request.kind, request.target) for request in lease_requests])

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
        next_ns = self._due_targets.next_ns(now_ns)
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
