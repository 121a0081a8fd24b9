"""Manages rollouts: starts and steers them for clients, and advances them, on one gateway of the store at a time.

What follows from what is decided by gateway/domain/fleet/rollout.py alone. A robot's place is taken in the store before
its twin is changed, and its twin is changed again until that is known to be done: whatever stops a gateway, no robot is
told without being counted.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import Any, Protocol, TypeVar

from gateway.domain.fleet import rollout as engine_of
from gateway.domain.fleet.recording import new_recording_id
from gateway.domain.fleet.rollout import IN_FLIGHT, OPEN, Facts, Plan, Rollout, health_of
from gateway.domain.idempotency import IdempotentRequest
from gateway.errors import InvalidRequestError, StoreError, TooManyError
from gateway.fleet.rollouts.errors import RolloutStateError, UnknownRolloutError
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.fleet.idempotency import made_before, remember_made
from gateway.store.fleet.rollouts import (
    add_rollout,
    list_rollouts,
    open_rollouts,
    read_rollout,
    save_rollout,
)
from gateway.store.fleet.updates import take_duty
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["FleetBackend", "RolloutManager"]

log = logging.getLogger(__name__)

Result = TypeVar("Result")
DUTY = "rollouts"
DUTY_NS = 15 * 10**9
TICK_S = 1.0
TRIES = 8
LISTED = 200


class FleetBackend(Protocol):
    """What a rollout needs of robots; the twin manager and the registry provide it."""

    async def named(self, selector: str) -> list[str]:
        """The robots that a selector names; SelectorError when it is none."""

    async def look(self, robots: Collection[str]) -> None:
        """Learn where all robots are, and what these ones reported, at whichever gateway they are linked."""

    def presence(self, robot: str) -> tuple[bool, int]:
        """Whether the robot is online, and since when it is or is not (wall time, ns); as of the last `look`."""

    def reported(self, robot: str) -> dict[str, Any] | None:
        """What the robot said last of itself; as of the last `look`."""

    def refusal(self, robot: str) -> str:
        """Why the robot does not live by its twin as it is desired now; "" while it may come to it."""

    async def set_path(self, robot: str, path: str, value: str, *, author: str) -> None:
        """Put a value into the robot's own twin; a MetarosError says why it cannot be there."""

    async def available(self, kind: str, name: str, version: str) -> bool:
        """Whether robots can fetch that version."""


class RolloutManager:
    """All methods on the event loop; steps of large rollouts are made on a thread."""

    def __init__(
        self,
        store: Store,
        fleet: FleetBackend,
        *,
        clock: Clock,
        changed: Callable[[Rollout], None] | None = None,
        limits: Limits = LIMITS,
    ) -> None:
        """`changed` hears of every rollout that begins, or is in another state."""
        self._listener = changed
        self._store = store
        self._fleet = fleet
        self._clock = clock
        self._limits = limits
        self._known: dict[str, tuple[Rollout, int]] = {}
        self._trouble = ""

    async def start(
        self, plan: Plan, *, by: str, sees: Callable[[str], bool], dry_run: bool, once: IdempotentRequest | None = None
    ) -> Rollout:
        """Begin a rollout to the robots that the plan's selector names and who asks may see.

        The same request under `once` is answered with the rollout that it began, as it is now; a dry run begins none.

        Raises:
            IdempotencyConflictError: the key was used for another request.
            InvalidRequestError: no robot is named, a wave is none, or robots cannot fetch the version.
            RolloutStateError: a rollout of the same thing that is not over has some of these robots.
            TooManyError: there are too many robots, or rollouts.
        """
        once = None if dry_run else once
        if begun := await self._read(lambda engine: made_before(engine, once)):
            return await self.get(begun)
        robots = [robot for robot in await self._fleet.named(plan.selector) if sees(robot)]
        if not robots:
            raise InvalidRequestError(f"the selector {plan.selector[:100]!r} names no robot")
        if len(robots) > self._limits.rollout_robots:
            raise TooManyError(f"{len(robots)} robots are named, at most {self._limits.rollout_robots} may be")
        await self._check_version(plan)
        now_ns = self._clock.wall_ns()
        try:
            made = engine_of.begin(new_recording_id(now_ns).lower(), plan, robots, now_ns=now_ns, created_by=by)
        except ValueError as error:
            raise InvalidRequestError(str(error)) from error

        def job(engine: StoreEngine) -> str:
            if begun := made_before(engine, once):
                return begun
            self._check_others(engine, made)
            if not dry_run:
                add_rollout(engine, made)
                remember_made(engine, once, made.id, now_ns=now_ns)
            return made.id

        begun = await self._store.run(job)
        if begun != made.id:  # the same request came twice at once
            return await self.get(begun)
        if not dry_run and self._listener is not None:
            self._listener(made)
        return made

    async def list(self) -> list[Rollout]:
        """The newest rollouts, newest first."""
        return await self._read(lambda engine: list_rollouts(engine, limit=LISTED))

    async def get(self, rollout_id: str) -> Rollout:
        """One rollout; UnknownRolloutError."""
        return (await self._get(rollout_id))[0]

    async def pause(self, rollout_id: str, reason: str) -> Rollout:
        """Tell nobody else until it is resumed; RolloutStateError when it does not run."""
        return await self._change(rollout_id, lambda one, now_ns: engine_of.pause(one, reason, now_ns))

    async def resume(self, rollout_id: str, *, version: str = "") -> Rollout:
        """Go on in spite of the failures; or with another version, from the first wave."""
        one = await self.get(rollout_id)
        await self._check_version(replace(one.plan, version=version or one.plan.version))
        return await self._change(rollout_id, lambda one, now_ns: engine_of.resume(one, now_ns, version=version))

    async def abort(self, rollout_id: str, reason: str) -> Rollout:
        """End it; robots keep what their twins say."""
        return await self._change(rollout_id, lambda one, now_ns: engine_of.abort(one, reason, now_ns))

    async def run(self) -> None:
        """Carry rollouts on for ever, whenever it is this gateway's turn."""
        while True:
            try:
                await self.tick()
                self._trouble = ""
            except StoreError as error:
                if str(error) != self._trouble:
                    log.warning("rollouts stand still: %s", error)
                self._trouble = str(error)
            await asyncio.sleep(TICK_S)

    async def tick(self) -> bool:
        """One step of every open rollout; whether it was this gateway's turn."""
        now_ns = self._clock.wall_ns()

        def look(engine: StoreEngine) -> dict[str, int] | None:
            found = open_rollouts(engine)
            if not found:
                return {}
            mine = take_duty(engine, DUTY, self._store.gateway_id, now_ns=now_ns, for_ns=DUTY_NS)
            return found if mine else None

        if not await self._read(open_rollouts):
            self._known.clear()
            return True
        found = await self._store.run(look)
        if found is None:
            self._known.clear()
            return False
        self._known = {key: item for key, item in self._known.items() if found.get(key) == item[1]}
        for rollout_id in found:
            await self._carry_on(rollout_id)
        return True

    async def _carry_on(self, rollout_id: str) -> None:
        one, revision = self._known.get(rollout_id) or await self._get(rollout_id)
        await self._fleet.look([robot for robot, member in one.members.items() if member.state in IN_FLIGHT])
        now_ns = self._clock.wall_ns()
        facts = {
            robot: self._facts(one, robot)
            for robot, member in one.members.items()
            if member.state == "waiting" or member.state in IN_FLIGHT
        }
        after = await asyncio.to_thread(engine_of.step, one, facts, now_ns)
        if after.state in OPEN and not await self._can_fetch(after.plan):
            text = f"robots cannot fetch {after.plan.bundle} {after.plan.version} any more: it was withdrawn"
            after = engine_of.withdrawn(after, text, now_ns)
        revision = await self._save(one, after, revision)
        if not revision:
            return
        settled = after
        for robot, member in after.members.items():
            if member.state == "starting" and after.state in OPEN:
                settled = await self._report(settled, robot)
        if settled is not after:
            changed = frozenset(r for r, m in settled.members.items() if m != after.members[r])
            await self._save(after, replace(settled, changed=changed), revision)

    async def _report(self, one: Rollout, robot: str) -> Rollout:
        try:
            author = f"rollout {one.id}"
            await self._fleet.set_path(robot, one.plan.path, one.plan.version, author=author)
        except StoreError:
            raise
        except MetarosError as error:
            return engine_of.refused(one, robot, f"its twin cannot hold it: {error}", self._clock.wall_ns())
        return engine_of.assigned(one, robot, self._clock.wall_ns())

    async def _save(self, before: Rollout, after: Rollout, revision: int) -> int:
        """The new revision; 0 when somebody else changed it meanwhile: it is read again with the next step."""
        if after == before and not after.changed:
            self._known[after.id] = (after, revision)
            return revision
        if after.state != before.state:
            log.warning("rollout %s is %s%s", after.id, after.state, f": {after.reason}" if after.reason else "")
        if not await self._store.run(lambda engine: save_rollout(engine, after, revision=revision)):
            self._known.pop(after.id, None)
            return 0
        self._known[after.id] = (after, revision + 1)
        if after.state != before.state and self._listener is not None:
            self._listener(after)
        return revision + 1

    def _facts(self, one: Rollout, robot: str) -> Facts:
        online, since_ns = self._fleet.presence(robot)
        if one.members[robot].state == "waiting":
            return Facts(online=online, offline_since_ns=since_ns)
        good, failure = health_of(one.plan, self._fleet.reported(robot))
        return Facts(online=online, offline_since_ns=since_ns, good=good, failure=failure or self._fleet.refusal(robot))

    async def _can_fetch(self, plan: Plan) -> bool:
        return await self._fleet.available(plan.kind, plan.bundle, plan.version)

    async def _check_version(self, plan: Plan) -> None:
        if not await self._can_fetch(plan):
            raise InvalidRequestError(
                f"robots cannot fetch {plan.bundle} {plan.version}: it is not uploaded, not signed, or withdrawn"
            )

    def _check_others(self, engine: StoreEngine, made: Rollout) -> None:
        others = open_rollouts(engine)
        if len(others) >= self._limits.rollouts_open:
            raise TooManyError(f"{len(others)} rollouts are not over")
        for rollout_id in others:
            found = read_rollout(engine, rollout_id)
            if found is None or found[0].plan.path != made.plan.path:
                continue
            both = sorted(found[0].members.keys() & made.members.keys())
            if both:
                raise RolloutStateError(
                    f"rollout {rollout_id} is not over, and has {both[0]} too: abort that one first"
                )

    async def _get(self, rollout_id: str) -> tuple[Rollout, int]:
        found = await self._read(lambda engine: read_rollout(engine, rollout_id))
        if found is None:
            raise UnknownRolloutError(f"there is no rollout {rollout_id[:40]!r}")
        return found

    async def _change(self, rollout_id: str, change: Callable[[Rollout, int], Rollout]) -> Rollout:
        for _ in range(TRIES):
            one, revision = await self._get(rollout_id)
            try:
                after = change(one, self._clock.wall_ns())
            except ValueError as error:
                raise RolloutStateError(f"rollout {rollout_id}: {error}") from error
            if await self._save(one, after, revision):
                return after
        raise StoreError(f"rollout {rollout_id} changes all the time: try again")

    async def _read(self, job: Callable[[StoreEngine], Result]) -> Result:
        def within(engine: StoreEngine) -> Result:
            with engine.transaction(write=False):
                return job(engine)

        return await self._store.read(within)
