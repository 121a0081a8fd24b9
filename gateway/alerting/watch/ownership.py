"""Which robots this gateway evaluates where several share a store: one gateway at a time owns a robot's detectors.

The gateway that has a robot's link owns it. Detectors are saved by and by, and when something was found; where the
robot links to another gateway, that one goes on from what was saved and from the rows since. A gateway owns its robots
as long as it says in the database that it lives. Robots whose gateway died and that came nowhere are owned by
whichever gateway takes them first, so that somebody says that they are offline.
"""

from __future__ import annotations

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable, Collection, Sequence
from functools import partial
from typing import Any, Final, Protocol

from gateway.alerting.watch.database import Database
from gateway.alerting.watch.handover import Handover, ReplayWindow
from gateway.alerting.watch.saves import Saves
from gateway.errors import StoreError
from gateway.store.alerting.watch_rows import RecentRows, read_recent
from gateway.store.alerting.watch_states import (
    Saved,
    drop_states,
    free_all,
    held_by,
    know_robots,
    orphans,
    read_state,
    save_states,
    take_states,
)
from gateway.store.engine import StoreEngine
from gateway.store.fleet.presence import say_alive
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["Ownership", "RobotLocations"]

log = logging.getLogger(__name__)

STEP_S: Final = 0.5
LOOK_S: Final = 2.0  # at what is this gateway's still, and what is nobody's
VALID_S: Final = 10.0  # for so long after it was said a gateway is believed to live
ORPHAN_S: Final = 20.0  # a robot of nobody has so long to come somewhere
FORCE_S: Final = 12.0  # a robot that is here is waited for so long, then taken from a gateway that lives
AT_ONCE: Final = 128  # robots that are taken, or let go, in one transaction
READS: Final = 2  # robots that are read from the store at a time


class RobotLocations(Protocol):
    """Where robots are."""

    def local(self) -> Collection[str]:
        """The robots that are linked to this gateway."""

    def is_remote(self, robot: str) -> bool:
        """Whether it is linked to another gateway of the store."""

    def expected(self, robot: str) -> bool:
        """Whether it may ever come."""


class Ownership:
    """All methods on the event loop. `gained` and `lost` are called for each robot, between two cycles."""

    def __init__(
        self,
        database: Database,
        handover: Handover,
        ask: Callable[[Callable[[], Any]], Awaitable[Any]],
        *,
        clock: Clock,
        where: RobotLocations,
        gained: Callable[[str], None],
        lost: Callable[[str], None],
    ) -> None:
        """`ask` does something on the evaluator's thread."""
        self.lock = asyncio.Lock()  # whoever has it changes whose robots are judged, or judges
        self.held: dict[str, int] = {}  # with the fence of each
        self.saves = Saves(every_s=LIMITS.watch_save_s)
        self._database = database
        self._handover = handover
        self._ask = ask
        self._clock = clock
        self._where = where
        self._gained, self._lost = gained, lost
        self._begun_s = clock.wall_ns() / 1e9
        self._sure_s = self._looked_s = -math.inf
        self._mine: dict[str, int] = {}  # by the store this gateway's, and not judged yet
        self._waited_s: dict[str, float] = {}  # since when a robot that is here is somebody else's
        self._alone_s: dict[str, float] = {}  # since when a robot is nobody's
        self._leaving: list[Saved] = []  # let go here, and not in the store
        self._trouble = ""
        self._closed = False

    @property
    def sure(self) -> bool:
        """Whether nobody else can have taken what this gateway has."""
        return self._clock.monotonic_s() - self._sure_s < VALID_S

    async def begin(self, robots: Collection[str] = ()) -> None:
        """What this gateway had before it ended is anybody's; somebody is to judge these robots too. StoreError."""
        me, now_ns = self._database.gateway_id, self._clock.wall_ns()

        def job(engine: StoreEngine) -> None:
            say_alive(engine, me, until_ns=now_ns + round(VALID_S * 1e9))
            free_all(engine, me)
            know_robots(engine, robots)

        await self._database.run(job)

    async def run(self) -> None:
        """Until cancelled. While the store fails nothing moves."""
        while True:
            try:
                await self.step()
                self._trouble = ""
            except StoreError as error:
                if str(error) != self._trouble:
                    log.warning("which robots are judged here cannot be stored or read now: %s", error)
                self._trouble = str(error)
            except Exception:  # a mistake of ours: what is judged here goes on
                log.exception("robots do not move between gateways for now")
            await asyncio.sleep(STEP_S)

    async def step(self) -> None:
        """Look, let go, take and save once. StoreError."""
        if self._closed:
            return
        if self._clock.monotonic_s() - self._looked_s >= LOOK_S:
            await self._look()
        await self._let_go()
        await self._take_all()
        await self.save(self.saves.due(self._clock.monotonic_s()))

    async def save(self, robots: Sequence[str], *, locked: bool = False) -> None:
        """Save some of these, the first ones, as much as is allowed at once; `locked`: the caller has the lock.

        Raises:
            StoreError: nothing was saved.
        """
        fences = {robot: self.held[robot] for robot in robots[:AT_ONCE] if robot in self.held}
        if not fences:
            return
        states = await self._dump(fences, LIMITS.watch_save_bytes)
        done = await self._store(states)
        for state in states:
            self.saves.saved(state.robot, self._clock.monotonic_s())
        gone = {state.robot: state.fence for state in states if state.robot not in done}
        if gone and not locked:  # else the next look says so
            await self._drop([robot for robot, fence in gone.items() if self.held.get(robot) == fence])

    async def close(self) -> None:
        """Save everything, and let it go: another gateway goes on. StoreError."""
        self._closed = True
        while self.held:
            await self._release(list(self.held)[:AT_ONCE])
        await self._store_leaving()

    async def _look(self) -> None:
        """Say that this gateway lives; what is its own still, and what is nobody's."""
        me, now_ns, began_s = self._database.gateway_id, self._clock.wall_ns(), self._clock.monotonic_s()

        def job(engine: StoreEngine) -> tuple[dict[str, int], list[str]]:
            say_alive(engine, me, until_ns=now_ns + round(VALID_S * 1e9))
            return held_by(engine, me), orphans(engine, now_ns=now_ns)

        held, alone = await self._database.run(job)
        await self._drop([robot for robot, fence in self.held.items() if held.get(robot) != fence])
        self._sure_s = self._looked_s = began_s
        leaving = {state.robot for state in self._leaving}
        self._mine = {robot: fence for robot, fence in held.items() if robot not in self.held and robot not in leaving}
        self._alone_s = {robot: self._alone_s.get(robot, began_s) for robot in alone}

    async def _let_go(self) -> None:
        """Robots that are linked elsewhere now, or that nobody expects."""
        if self._leaving:
            await self._store_leaving()
        here = self._where.local()
        away = [robot for robot in self.held if robot not in here]
        await self._release([robot for robot in away if self._where.is_remote(robot)][:AT_ONCE])
        gone = [robot for robot in away if robot in self.held and not self._where.expected(robot)]
        if gone:
            await self._drop(gone)
            await self._database.run(lambda engine: drop_states(engine, gone))

    async def _release(self, robots: Sequence[str]) -> None:
        """Judge these no more, save them, and leave them to others."""
        if not robots:
            return
        async with self.lock:
            fences = {robot: self.held.pop(robot) for robot in robots}
            self._leaving += await self._dump(fences, math.inf)
            await self._forget(robots)
        await self._store_leaving()

    async def _store_leaving(self) -> None:
        """In pieces, so that no commit of rows waits for long."""
        while self._leaving:
            some, size_bytes = 0, 0
            while some < len(self._leaving) and size_bytes < LIMITS.watch_save_bytes:
                size_bytes += len(self._leaving[some].state)
                some += 1
            await self._store(self._leaving[:some], free=True)
            del self._leaving[:some]

    async def _drop(self, robots: Sequence[str]) -> None:
        """Another gateway has taken these, or nobody is to have them."""
        if robots:
            async with self.lock:
                for robot in robots:
                    self.held.pop(robot, None)
                await self._forget(robots)

    async def _forget(self, robots: Sequence[str]) -> None:
        def job() -> None:
            for robot in robots:
                self._handover.forget(robot)

        await self._ask(job)
        for robot in robots:
            self.saves.forget(robot)
            self._lost(robot)

    async def _take_all(self) -> None:
        """Robots that are here, and those of nobody that came nowhere for a while."""
        now_s, here = self._clock.monotonic_s(), self._where.local()
        wanted = [robot for robot in here if robot not in self.held and robot not in self._mine]
        self._waited_s = {robot: self._waited_s.get(robot, now_s) for robot in wanted}
        alone = [robot for robot, since_s in self._alone_s.items() if now_s - since_s >= ORPHAN_S]
        alone = [robot for robot in alone if robot not in here and not self._where.is_remote(robot)]
        forced = [robot for robot, since_s in self._waited_s.items() if now_s - since_s >= FORCE_S]
        self._mine |= await self._take([*wanted, *alone][:AT_ONCE])
        self._mine |= await self._take([robot for robot in forced if robot not in self._mine][:AT_ONCE], force=True)
        rest = iter(sorted((robot, fence) for robot, fence in self._mine.items() if robot not in self.held))

        async def adopt_some() -> None:
            for robot, fence in rest:
                try:
                    await self._adopt(robot, fence)
                except StoreError:
                    raise
                except Exception:  # the others must not wait for it
                    log.exception("robot %s is not judged by anybody: a mistake of ours", robot)

        done = await asyncio.gather(*(adopt_some() for _ in range(READS)), return_exceptions=True)
        for error in done:
            if isinstance(error, BaseException):
                raise error

    async def _take(self, robots: Sequence[str], *, force: bool = False) -> dict[str, int]:
        if not robots:
            return {}
        me, now_ns = self._database.gateway_id, self._clock.wall_ns()
        return await self._database.run(lambda engine: take_states(engine, robots, me, now_ns=now_ns, force=force))

    async def _adopt(self, robot: str, fence: int) -> None:
        """Go on with a robot that is this gateway's."""
        now_ns = self._clock.wall_ns()
        saved, rows, window = await self._database.read_slowly(partial(_read, robot=robot, now_ns=now_ns))
        if saved is None or saved.fence != fence:
            self._mine.pop(robot, None)
            return
        times = {"since_s": self._begun_s, "now_s": now_ns / 1e9}
        async with self.lock:
            await self._ask(lambda: self._handover.adopt(saved, rows, window, **times))
            self.held[robot] = fence
            self._mine.pop(robot, None)
            self._alone_s.pop(robot, None)
            self.saves.begin(robot, self._clock.monotonic_s())
            self._gained(robot)

    async def _dump(self, fences: dict[str, int], most_bytes: float) -> list[Saved]:
        now_ns = self._clock.wall_ns()
        dumped: list[Saved] = await self._ask(lambda: self._handover.dump(fences, most_bytes=most_bytes, now_ns=now_ns))
        return dumped

    async def _store(self, states: Sequence[Saved], *, free: bool = False) -> set[str]:
        me = self._database.gateway_id
        return await self._database.run(lambda engine: save_states(engine, me, states, free=free))


def _read(engine: StoreEngine, *, robot: str, now_ns: int) -> tuple[Saved | None, RecentRows, ReplayWindow]:
    """What was saved of a robot, and its rows since."""
    with engine.transaction(write=False):
        saved = read_state(engine, robot)
    window = ReplayWindow.after(saved, now_ns)
    most = LIMITS.watch_replay_rows
    return saved, read_recent(engine, robot, start_ns=window.start_ns, end_ns=window.end_ns, most=most), window
