"""Functions as the gateway runs them: catalogue, engine, calls, events, mappings and canaries, put together."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gateway.domain.delivery import Handler, Put
from gateway.domain.happening import Happening
from gateway.errors import StoreError
from gateway.functions.async_invoke import EventHandler
from gateway.functions.async_put import FUNCTION
from gateway.functions.canary import Canaries
from gateway.functions.catalogue import Catalogue
from gateway.functions.destination_handler import AwsSender, DestinationHandler
from gateway.functions.destinations import DESTINATION
from gateway.functions.invoker import Invoker, Rng
from gateway.functions.lazy_engine import EngineDoor
from gateway.functions.ledger import Ledger
from gateway.functions.logs import LogBook
from gateway.functions.mapping_turn import Turns
from gateway.functions.mappings import Mappings
from gateway.functions.meters import FunctionMeters
from gateway.objects import ObjectStore
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.mapping_cursors import Stream
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.functions.egress_rules import EgressRules
from metaros.functions.engine import Engine
from metaros.functions.sandbox.level import Level
from metaros.limits import LIMITS, Limits

__all__ = ["FunctionChoices", "Functions", "Ways"]

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionChoices:
    """`require` is the least sandbox that will do; `workers` bounds the processes of all functions, `egress` where they
    may ask to connect to (None: anywhere)."""

    on: bool = True
    require: Level = Level.L0
    workers: int = LIMITS.function_workers
    egress: EgressRules | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Ways:
    """What functions have of the other parts: the queue, the bus, AWS and the journal.

    `accept` makes puts durable; `put` stores them in a transaction of one's own, after which `noted` is told.
    """

    accept: Callable[[Sequence[Put]], Awaitable[Sequence[str]]]
    put: Callable[[StoreEngine, Sequence[Put]], object]
    noted: Callable[[Sequence[Put]], None]
    happen: Callable[[Sequence[Happening]], Awaitable[object]]
    aws: AwsSender
    emit: Callable[[str, str, Mapping[str, Any]], None]


class Functions:
    """Start it before the first call, let `run` run; lives on the event loop."""

    def __init__(
        self,
        store: Store,
        objects: ObjectStore,
        folder: Path,
        ways: Ways,
        *,
        choices: FunctionChoices,
        clock: Clock,
        rng: Rng,
        limits: Limits = LIMITS,
    ) -> None:
        self.choices = choices
        self._limits = limits
        self._clock = clock
        self._folder = folder
        self.logs = LogBook(limits=limits)
        self.engine = EngineDoor(self._make if choices.on else None, on_log=self.logs.add, clock=clock)
        held = self.engine.in_use
        self.catalogue = Catalogue(store, objects, folder / "code", clock=clock, in_use=held, limits=limits)
        self.meters = FunctionMeters(clock=clock, limits=limits)
        self.ledger = Ledger(store, self.meters, clock=clock, limits=limits)
        self.invoker = Invoker(
            self.engine, self.catalogue, self.ledger, accept=ways.accept, clock=clock, rng=rng, limits=limits
        )
        self.canaries = Canaries(store, self.catalogue, emit=ways.emit, clock=clock, limits=limits)
        self.invoker.listeners.append(self.canaries.count)
        turns = Turns(store, self.invoker, put=ways.put, clock=clock)
        self.mappings = Mappings(store, self.catalogue, turns, noted=ways.noted, clock=clock, limits=limits)
        self._ways = ways
        self._changed: set[str] = set()
        self._news = asyncio.Event()
        self.catalogue.on_change(self._on_change)

    def handlers(self) -> dict[str, Handler]:
        """What the queue gives to functions, by kind."""
        clock, limits, ways = self._clock, self._limits, self._ways
        events = EventHandler(self.invoker, self.catalogue, on=self.choices.on, clock=clock, limits=limits)
        ends = DestinationHandler(ways.aws, ways.happen, clock=clock, limits=limits)
        return {FUNCTION: events, DESTINATION: ends}

    async def start(self) -> None:
        """Know what there is. Raises StoreError; ConfigError where less protection is to be had than is required."""
        await self.catalogue.start()
        await self.ledger.start()
        if self.choices.on and self.choices.require > Level.L0:
            await self.engine.open()
        self._changed |= set(self.catalogue.names())
        self._news.set()

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            for part in (self.catalogue, self.ledger, self.canaries):
                group.create_task(part.run())
            if self.choices.on:
                group.create_task(self.mappings.run())
                group.create_task(self._keep_pools())

    async def close(self) -> None:
        """Let calls end, as long as they may; then nothing runs any more."""
        self.logs.end()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(self._limits.function_drain_s):
                await self.invoker.idle()
        await self.engine.close()
        await self.ledger.close()

    def on_committed(self, found: Iterable[tuple[Stream, str]]) -> None:
        """Streams of which more is stored, with their topics."""
        self.mappings.on_committed(found)

    def _make(self) -> Engine:
        choices = self.choices
        return Engine(
            self._folder,
            clock=self._clock,
            require=choices.require,
            most_workers=choices.workers,
            egress=choices.egress,
            limits=self._limits,
        )

    def _on_change(self, function: str) -> None:
        if function:
            self._changed.add(function)
            self._news.set()

    async def _keep_pools(self) -> None:
        """Retire what was changed or deleted, and have warm what is to be."""
        while True:
            await self._news.wait()
            self._news.clear()
            changed, self._changed = self._changed, set()
            for function in changed:
                try:
                    await self._keep_pool(function)
                except (StoreError, MetarosError) as error:
                    log.debug("the workers of %s: %s", function, error)

    async def _keep_pool(self, function: str) -> None:
        engine, known = self.engine.peek(), function in self.catalogue.names()
        if not known:
            self.meters.forget(function)
            self.logs.forget(function)
        for pool in engine.status().pools if engine is not None else ():
            if pool.function == function and (not known or await self._is_old(pool.key, function, pool.version)):
                assert engine is not None
                await engine.retire(pool.key)
        if known:
            await self._warm(function)

    async def _is_old(self, key: str, function: str, version: str) -> bool:
        try:
            return (await self.catalogue.spec(function, version)).key != key
        except MetarosError:
            return True

    async def _warm(self, function: str) -> None:
        found = await self.catalogue.do("ListProvisionedConcurrencyConfigs", {"FunctionName": function})
        for item in found["ProvisionedConcurrencyConfigs"]:
            qualifier = str(item["FunctionArn"]).rpartition(":")[2]
            for version, _ in self.catalogue.resolve(function, qualifier).versions[:1]:
                spec = await self.catalogue.spec(function, version)
                await (await self.engine.open()).warm(spec)
