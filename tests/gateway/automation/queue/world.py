"""Gateways' desks on one store, with handlers that do as they are told and a clock that moves when told."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from gateway.automation.queue.manager import QueueManager
from gateway.domain.automation.delivery import Dead, Delivery, Done, Put, Result, Totals
from gateway.store import Store
from gateway.store.retention import Retention
from metaros.clock import ManualClock
from metaros.limits import LIMITS, Limits
from tests.support.servers.sqlite_store import place_store

__all__ = ["Reported", "World", "one"]

KIND = "function"


def one(target: str = "t", payload: bytes = b"x", **more: object) -> Put:
    """Something to deliver."""
    return Put(kind=KIND, target=target, payload=payload, **more)  # type: ignore[arg-type]


async def _done(delivery: Delivery) -> Result:
    return Done()


@dataclass(slots=True)
class Reported:
    """A handler: `act` is what it does, `follow` what it puts as a delivery ends."""

    act: Callable[[Delivery], Awaitable[Result]] = _done
    follow: Callable[[Delivery, Done | Dead], Sequence[Put]] = lambda delivery, result: ()
    at_once: int = 100
    of_target: int = 100
    longest_s: float = 30.0
    begun: list[Delivery] = field(default_factory=list)
    ends: list[tuple[str, Done | Dead]] = field(default_factory=list)
    under_way: list[str] = field(default_factory=list)
    most_under_way: int = 0

    def room(self, target: str | None = None) -> int:
        """How many more it takes."""
        if target is None:
            return self.at_once - len(self.under_way)
        return self.of_target - self.under_way.count(target)

    def timeout_s(self, target: str) -> float:
        """How long a call may take."""
        return self.longest_s

    async def deliver(self, delivery: Delivery) -> Result:
        """As told."""
        self.begun.append(delivery)
        self.under_way.append(delivery.put.target)
        self.most_under_way = max(self.most_under_way, len(self.under_way))
        try:
            return await self.act(delivery)
        finally:
            self.under_way.remove(delivery.put.target)

    def ended(self, delivery: Delivery, result: Done | Dead) -> Sequence[Put]:
        """As told."""
        self.ends.append((delivery.id, result))
        return self.follow(delivery, result)


class World:
    """One store, a clock, and gateways."""

    def __init__(self, folder: Path, url: str) -> None:
        self.clock = ManualClock()
        self.folder, self.url = folder, url
        self.shared = bool(url)
        self._stores: dict[str, Store] = {}
        self._managers: list[QueueManager] = []

    def store(self, name: str = "a") -> Store:
        """A gateway's store; by another name another gateway's, where the database can be shared."""
        if name not in self._stores:
            folder, retention = self.folder / name, Retention(age_s=1e9, size_bytes=1 << 50)
            if not self.shared:
                place_store(folder)
            store = Store(folder, clock=self.clock, retention=retention, queue_bytes=1 << 26, url=self.url)
            store.start()
            self._stores[name] = store
        return self._stores[name]

    async def manager(
        self, handler: Reported, *, name: str = "a", seed: int = 1, limits: Limits = LIMITS
    ) -> QueueManager:
        """A life of a gateway."""
        manager = QueueManager(self.store(name), clock=self.clock, rng=random.Random(seed), limits=limits)
        manager.handle(KIND, handler)
        await manager.start()
        self._managers.append(manager)
        return manager

    async def drive(self, manager: QueueManager) -> int:
        """Deliver what is due now, and what follows from it; how many tries."""
        tries = 0
        while True:
            await manager.dispatcher.scan()
            await manager.dispatcher.expire()
            begun = await manager.dispatcher.step()
            await manager.dispatcher.in_flight.empty(timeout_s=30.0)
            if not begun:
                return tries
            tries += begun

    async def crash(self, manager: QueueManager) -> None:
        """End a life without a word: whatever it has leased stays leased."""
        self._managers.remove(manager)
        await manager.dispatcher.in_flight.abort()

    async def totals(self) -> Totals:
        """What the store counted."""
        return (await self._any().status()).totals

    async def counted(self) -> dict[str, int]:
        """What the store really holds, by state."""

        def job(engine: object) -> dict[str, int]:
            rows = engine.fetch("SELECT state, count(*) FROM deliveries GROUP BY state")  # type: ignore[attr-defined]
            return {state: int(count) for state, count in rows}

        return await self.store().run(job)

    async def close(self) -> None:
        """End all of it."""
        for manager in self._managers:
            await manager.close(timeout_s=0.0)
        await asyncio.gather(*(store.close() for store in self._stores.values()))

    def _any(self) -> QueueManager:
        return self._managers[-1]
