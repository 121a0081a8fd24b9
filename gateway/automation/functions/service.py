"""The functions service: catalogue, engine, calls, events, mappings and canaries, put together."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gateway.automation.functions.async_invoke import EventHandler
from gateway.automation.functions.async_put import FUNCTION
from gateway.automation.functions.canary import Canaries
from gateway.automation.functions.catalogue.catalogue import Catalogue
from gateway.automation.functions.destination_handler import AwsSender, DestinationHandler
from gateway.automation.functions.destinations import DESTINATION
from gateway.automation.functions.invoker import Invoker, Rng
from gateway.automation.functions.lazy_engine import LazyEngine
from gateway.automation.functions.ledger import Ledger
from gateway.automation.functions.logs import LogBuffer
from gateway.automation.functions.mappings.batch_run import BatchRunner
from gateway.automation.functions.mappings.mappings import Mappings
from gateway.automation.functions.meters import FunctionMeters
from gateway.domain.automation.delivery import Handler, Put
from gateway.domain.automation.gateway_event import GatewayEvent
from gateway.errors import StoreError
from gateway.store import Store
from gateway.store.automation.mapping_cursors import Stream
from gateway.store.engine import StoreEngine
from gateway.store.objects import ObjectStore
from metaros.automation.functions.egress.rules import EgressRules
from metaros.automation.functions.engine import Engine
from metaros.automation.functions.sandbox.level import Level
from metaros.clock import Clock
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["FunctionOptions", "FunctionPorts", "Functions"]

log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionOptions:
    """`require` is the least sandbox that will do; `workers` bounds the processes of all functions, `egress` where they
    may ask to connect to (None: anywhere)."""

    on: bool = True
    require: Level = Level.L0
    workers: int = LIMITS.function_workers
    egress: EgressRules | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class FunctionPorts:
    """What functions need of other parts: the queue, the bus, AWS and the journal.

    `accept` makes puts durable; `put` stores them in a transaction of one's own, after which `notify` is told.
    """

    accept: Callable[[Sequence[Put]], Awaitable[Sequence[str]]]
    put: Callable[[StoreEngine, Sequence[Put]], object]
    notify: Callable[[Sequence[Put]], None]
    put_events: Callable[[Sequence[GatewayEvent]], Awaitable[object]]
    aws: AwsSender
    emit: Callable[[str, str, Mapping[str, Any]], None]


class Functions:
    """Start it before the first call, let `run` run; lives on the event loop."""

    def __init__(
        self,
        store: Store,
        objects: ObjectStore,
        folder: Path,
        ports: FunctionPorts,
        *,
        choices: FunctionOptions,
        clock: Clock,
        rng: Rng,
        limits: Limits = LIMITS,
    ) -> None:
        self.choices = choices
        self._limits = limits
        self._clock = clock
        self._folder = folder
        self.logs = LogBuffer(limits=limits)
        self.engine = LazyEngine(self._make if choices.on else None, on_log=self.logs.add, clock=clock)
        held = self.engine.in_use
        self.catalogue = Catalogue(store, objects, folder / "code", clock=clock, in_use=held, limits=limits)
        self.meters = FunctionMeters(clock=clock, limits=limits)
        self.ledger = Ledger(store, self.meters, clock=clock, limits=limits)
        self.invoker = Invoker(
            self.engine, self.catalogue, self.ledger, accept=ports.accept, clock=clock, rng=rng, limits=limits
        )
        self.canaries = Canaries(store, self.catalogue, emit=ports.emit, clock=clock, limits=limits)
        self.invoker.listeners.append(self.canaries.count)
        batch_runner = BatchRunner(store, self.invoker, put=ports.put, clock=clock)
        self.mappings = Mappings(store, self.catalogue, batch_runner, notify=ports.notify, clock=clock, limits=limits)
        self._ports = ports
        self._changed: set[str] = set()
        self._news = asyncio.Event()
        self.catalogue.on_change(self._on_change)

    def handlers(self) -> dict[str, Handler]:
        """What the queue gives to functions, by kind."""
        clock, limits, ports = self._clock, self._limits, self._ports
        events = EventHandler(self.invoker, self.catalogue, on=self.choices.on, clock=clock, limits=limits)
        ends = DestinationHandler(ports.aws, ports.put_events, clock=clock, limits=limits)
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
