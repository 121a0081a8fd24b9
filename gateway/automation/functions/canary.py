"""Canaries as the gateway runs them: calls counted, and aliases moved on or back. All methods on the event loop.

What was decided is stored before the alias is changed, and marked when it was: whoever dies in between, it is done.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol, TypeVar

from gateway.automation.functions.directory import Directory
from gateway.automation.functions.errors import FunctionConflictError, FunctionInvalidError, UnknownFunctionError
from gateway.domain.automation.canary import CANCELLED, ROLLED_BACK, RUNNING, Canary, judged
from gateway.errors import RequestError, StoreError, TooManyError
from gateway.store.automation import canaries as table
from gateway.store.engine import StoreEngine
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Canaries", "Database"]

log = logging.getLogger(__name__)
Result = TypeVar("Result")
LOOK_S = 1.0
KIND = "function.canary"


class Database(Protocol):
    """What is needed of the store."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""


class Canaries:
    """Begin and cancel; `run` looks after them."""

    def __init__(
        self,
        database: Database,
        directory: Directory,
        *,
        emit: Callable[[str, str, Mapping[str, Any]], None],
        clock: Clock,
        limits: Limits = LIMITS,
    ) -> None:
        self._database = database
        self._directory = directory
        self._emit = emit
        self._clock = clock
        self._limits = limits
        self._known: dict[tuple[str, str], Canary] = {}
        self._counts: dict[tuple[str, str], list[int]] = {}

    def of(self, function: str, alias: str) -> Canary | None:
        """The last canary of an alias, as it was at the last look."""
        return self._known.get((function, alias))

    def count(self, function: str, qualifier: str, version: str, ok: bool) -> None:
        """A call is over."""
        canary = self._known.get((function, qualifier))
        if canary is not None and canary.state == RUNNING and canary.version == version:
            counts = self._counts.setdefault((function, qualifier), [0, 0])
            counts[0] += 1
            counts[1] += not ok

    async def begin(self, asked: Canary) -> Canary:
        """Let an alias lead to another version now and then; `stable` is found.

        Raises:
            UnknownFunctionError, FunctionInvalidError, FunctionConflictError, TooManyError, StoreError.
        """
        known = self._known.get((asked.function, asked.alias))
        if known is not None and known.state == RUNNING:
            raise FunctionConflictError(
                f"alias {asked.alias} of {asked.function} has a canary: version {known.version}"
            )
        if sum(item.state == RUNNING for item in self._known.values()) >= self._limits.canaries:
            raise TooManyError(f"{self._limits.canaries} canaries are under way")
        target = self._directory.resolve(asked.function, asked.alias)
        stable = max(target.versions, key=lambda item: item[1])[0]
        new = self._directory.resolve(asked.function, asked.version).versions[0][0]
        if new == stable:
            raise FunctionInvalidError(f"alias {asked.alias} leads to version {stable} already")
        now_ns = self._clock.wall_ns()
        made = replace(asked, stable=stable, version=new, state=RUNNING, began_ns=now_ns, changed_ns=now_ns, revision=0)
        await self._database.run(lambda engine: table.save_canary(engine, made))
        return await self._apply(await self._read(made))

    async def cancel(self, function: str, alias: str, *, by: str) -> Canary:
        """Back to the stable version. Raises UnknownFunctionError where none is under way."""
        found = await self._read_one(function, alias)
        if found is None or found.state != RUNNING:
            raise UnknownFunctionError(f"alias {alias} of {function} has no canary under way")
        now_ns = self._clock.wall_ns()
        ended = replace(found, state=CANCELLED, reason=f"cancelled by {by}", changed_ns=now_ns, applied=False)
        if not await self._database.run(lambda engine: table.save_canary(engine, ended)):
            raise FunctionConflictError(f"the canary of {function}:{alias} has just changed")
        return await self._apply(await self._read(ended))

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            try:
                await self.evaluate()
            except StoreError as error:
                log.debug("canaries wait for the store: %s", error)
            except RequestError:
                continue  # it was told, and is no more
            except Exception:  # whatever is wrong with one, the gateway goes on
                log.exception("canaries failed: a mistake of ours")
            await asyncio.sleep(LOOK_S)

    async def evaluate(self) -> None:
        """Judge those under way, and do what was decided. Raises StoreError."""
        now_ns = self._clock.wall_ns()
        counts, self._counts = self._counts, {}

        def job(engine: StoreEngine) -> list[Canary]:
            after = []
            for canary in table.read_canaries(engine):
                calls, errors = counts.get((canary.function, canary.alias), (0, 0))
                now = judged(canary, invocations=calls, errors=errors, now_ns=now_ns)
                if now != canary:
                    table.save_canary(engine, now)
                    now = replace(now, revision=canary.revision + 1)
                after.append(now)
            return after

        if not counts and not await self._database.read(_any):
            self._known.clear()
            return
        try:
            found = await self._database.run(job)
        except StoreError:
            for key, (calls, errors) in counts.items():
                kept = self._counts.setdefault(key, [0, 0])
                kept[0], kept[1] = kept[0] + calls, kept[1] + errors
            raise
        self._known = {(item.function, item.alias): item for item in found}
        for canary in found:
            await self._apply(canary)

    async def _apply(self, canary: Canary) -> Canary:
        """Let the alias be as the canary says; where it is gone, so is the canary. Who marks it done tells it: whoever
        begins a canary and the look that finds it meet here.
        """
        version, weights = canary.weights
        key = (canary.function, canary.alias)
        if canary.applied:
            self._known[key] = canary
            return canary
        try:
            await self._directory.set_weights(*key, version, weights, by=canary.by or "canary")
        except RequestError as error:
            log.warning("the canary of %s:%s is over: %s", *key, error)
            await self._database.run(lambda engine: table.delete_canary(engine, *key))
            self._known.pop(key, None)
            raise
        done = replace(canary, applied=True)
        if not await self._database.run(lambda engine: table.save_canary(engine, done)):
            self._known[key] = found = await self._read(done)
            return found
        done = replace(done, revision=canary.revision + 1)
        self._known[key] = done
        self._emit(KIND, "", _reported(done))
        if done.state == ROLLED_BACK:
            log.warning("alias %s of %s is back at version %s: %s", done.alias, done.function, version, done.reason)
        return done

    async def _read(self, canary: Canary) -> Canary:
        return await self._read_one(canary.function, canary.alias) or canary

    async def _read_one(self, function: str, alias: str) -> Canary | None:
        return await self._database.run(lambda engine: table.read_canary(engine, function, alias))


def _any(engine: StoreEngine) -> bool:
    with engine.transaction(write=False):
        return bool(table.read_canaries(engine))


def _reported(canary: Canary) -> dict[str, Any]:
    names = ("function", "alias", "version", "stable", "weight", "state", "reason")
    return {name: getattr(canary, name) for name in names}
