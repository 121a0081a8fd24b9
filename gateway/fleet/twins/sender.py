"""Sends desired states to robots, and takes their reports.

A robot is told once a session, and after each change; it hears nothing before it has reported, as an older agent does
not know these frames. Sending is spread over time: a change of the whole fleet goes out at `PER_S` robots a second.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable, Mapping

from gateway.domain.fleet.twin import Desired, Reported, made_of
from gateway.errors import RobotOfflineError, StoreError
from gateway.fleet.robots import SendFrame
from gateway.fleet.twins.cache import TwinCache
from gateway.fleet.twins.plan import MAX_REVISION, Author, Edit, Plan, labels_of
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.fleet.twins import collect_documents, next_change, write_twins
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["TwinSender"]

log = logging.getLogger(__name__)

PER_S = LIMITS.twins_told_per_s
STEP_S = 0.025
LOOK_S = 1.0  # how often it is asked what other gateways changed, and reports are stored
COLLECT_EVERY_S = 3600.0
SETTLED_AT_ONCE = 1000


class TwinSender:
    """Robots of this gateway and their twins; all methods on the event loop."""

    def __init__(
        self,
        store: Store,
        cache: TwinCache,
        send: SendFrame,
        labels: Callable[[str], Mapping[str, str]],
        *,
        clock: Clock,
    ) -> None:
        """`labels`: what a robot said of itself in its Hello."""
        self._store = store
        self._cache = cache
        self._send = send
        self._labels = labels
        self._clock = clock
        self._here: set[str] = set()  # that have reported in this session
        self._reported: dict[str, int] = {}
        self._due: dict[str, None] = {}
        self._unsettled: dict[str, None] = {}
        self._stirred = asyncio.Event()
        self._stale = False  # somebody says that the store has news
        self._failed = False
        self.edited: Callable[[], None] = lambda: None  # for other gateways: see `look`

    def on_online(self, robot: str, online: bool) -> None:
        """A link is whole or ended: what was said over the one before counts no more.

        The first report may come before the link is whole, on its control lane: it is answered now.
        """
        self._reported.pop(robot, None)
        self._due.pop(robot, None)
        if not online:
            self._here.discard(robot)
        elif robot in self._here:
            self._confirm(self._cache.reported[robot])
            self.send([robot])

    def on_report(self, robot: str, frame: link_pb2.TwinReport) -> None:
        """A robot says what it is; `confirming` over this living link is what it waits for."""
        if max(frame.revision, frame.applied) > MAX_REVISION:
            log.warning("robot %s reports a revision that nobody ever gave: %d", robot, frame.revision)
            return
        item = self._cache.report(robot, frame, wall_ns=self._clock.wall_ns())
        self._here.add(robot)
        self._confirm(item)
        desired = self._cache.desired.get(robot)
        if self._unlike(robot, desired) or (desired is not None and _ahead(item, desired)):
            self._unsettled[robot] = None
            self._stirred.set()
        self.send([robot])

    def _confirm(self, item: Reported) -> None:
        if item.state == "confirming":
            self._put(item.robot, link_pb2.GatewayFrame(twin_confirmed=link_pb2.TwinConfirmed(revision=item.revision)))

    def send(self, robots: list[str]) -> None:
        """Send these robots their desired states, unless they have them."""
        for robot in robots:
            desired, item = self._cache.desired.get(robot), self._cache.reported.get(robot)
            if robot not in self._here or desired is None or item is None or not desired.revision:
                continue
            if item.revision < desired.revision and self._reported.get(robot, 0) < desired.revision:
                self._due[robot] = None
                self._stirred.set()

    async def refresh(self) -> None:
        """Read what was stored, here or at other gateways, and send it to robots. StoreError when it cannot be read."""
        known = self._cache.templates_change
        self.send(await self._cache.refresh())
        if self._cache.templates_change != known:  # a robot that nobody knew as they changed is named by them, too
            unlike = [robot for robot in self._here if self._unlike(robot, self._cache.desired.get(robot))]
            self._unsettled.update(dict.fromkeys(unlike))
            self._stirred.set()

    def look(self) -> None:
        """Another gateway has stored something: it is learned now, and not at the next look."""
        self._stale = True
        self._stirred.set()

    async def run(self) -> None:
        """Send, settle, look at what others changed, store reports; until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._deliver())
            group.create_task(self._look())

    async def _deliver(self) -> None:
        while True:
            await self._stirred.wait()
            self._stirred.clear()
            if self._stale:
                self._stale = False
                with contextlib.suppress(StoreError):  # the next look tells of it
                    await self.refresh()
            if self._unsettled:
                await self._settle()
            while self._due:
                for robot in list(self._due)[: max(1, round(PER_S * STEP_S))]:
                    self._deliver_one(robot)
                await asyncio.sleep(STEP_S)

    def _deliver_one(self, robot: str) -> None:
        self._due.pop(robot, None)
        desired = self._cache.desired[robot]
        frame = link_pb2.TwinDesired(
            revision=desired.revision,
            sha256=desired.sha256,
            document=desired.document,
            confirm_within_ms=round(desired.confirm_within_s * 1000),
        )
        if self._put(robot, link_pb2.GatewayFrame(twin=frame)):
            self._reported[robot] = desired.revision

    def _put(self, robot: str, frame: link_pb2.GatewayFrame) -> bool:
        with contextlib.suppress(RobotOfflineError):
            self._send(robot, frame)
            return True
        return False

    async def _look(self) -> None:
        """A trouble is told once, until it is over."""
        collected_s = self._clock.monotonic_s()
        while True:
            await asyncio.sleep(LOOK_S)
            try:
                if self._store.shared:
                    await self.refresh()
                await self._cache.save()
                if self._unsettled:
                    self._stirred.set()
                if self._clock.monotonic_s() - collected_s >= COLLECT_EVERY_S:
                    collected_s = self._clock.monotonic_s()
                    await self._store.run(_collect)
                self._failed = False
            except StoreError as error:
                if not self._failed:
                    log.warning("twins cannot be stored or read now: %s", error)
                self._failed = True

    async def _settle(self) -> None:
        """Robots whose templates are others than before, or who know a newer revision than the store does."""
        robots = list(self._unsettled)[:SETTLED_AT_ONCE]
        cached = {robot: self._cache.reported[robot] for robot in robots}
        author = Author(name="gateway", at_ns=self._clock.wall_ns(), reason="labels, templates or the store changed")

        def job(engine: StoreEngine) -> tuple[list[str], list[Desired]]:
            change = next_change(engine)
            plan = Plan(engine, robots, self._cache.seen_revisions(robots))
            known = [robot for robot in robots if robot in plan.said]

            def edit(robot: str) -> Edit:
                before = plan.require(robot)
                return Edit(above=cached[robot].revision) if _ahead(cached[robot], before) else Edit()

            after = [item.after for item in plan.outcomes(known, edit, author, change=change) if item.changed]
            write_twins(engine, after)
            return known, [*after, *(plan.twins[robot] for robot in known if robot in plan.twins)]

        try:
            known, found = await self._store.run(job)
        except StoreError:
            return  # they stay unsettled; the next look tries again
        for robot in robots:  # one that the store does not know yet waits for the next look
            if robot in known or robot not in self._here:
                self._unsettled.pop(robot, None)
        self.send(self._cache.learn(found))
        if len(robots) == SETTLED_AT_ONCE:
            self._stirred.set()

    def _unlike(self, robot: str, desired: Desired | None) -> bool:
        """Whether other templates name the robot than those its desired state was made of."""
        labels = labels_of(self._labels(robot), desired)
        marks = tuple(item.mark for item in made_of(self._cache.templates.values(), robot, labels))
        return marks != (desired.templates if desired is not None else ())


def _ahead(item: Reported, desired: Desired) -> bool:
    """Whether a robot has seen more than the store has: it was restored. Without a desired state it may stay so."""
    if not desired.revision:
        return False
    other = item.applied == desired.revision and item.state == "applied" and item.sha256 != desired.sha256
    return item.revision > desired.revision or (item.revision == desired.revision and other)


def _collect(engine: StoreEngine) -> None:
    next_change(engine)
    collect_documents(engine)
