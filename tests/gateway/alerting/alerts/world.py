"""A desk of alerts on a real store, run as the gateway runs it, with what it told and emitted."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from gateway.alerting.alerts.config import AlertConfig
from gateway.alerting.alerts.manager import AlertManager
from gateway.domain.alert import Alert
from gateway.domain.finding import Edge
from gateway.store import Store
from gateway.store.retention import Retention
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.gateway.alerting.alerts.findings import NOW


@dataclass
class World:
    """The clock moves by hand; `step` is what the manager's own loop does once a second."""

    manager: AlertManager
    store: Store
    clock: ManualClock
    told: list[tuple[str, Alert]] = field(default_factory=list)
    events: list[tuple[str, str, Mapping[str, Any]]] = field(default_factory=list)

    @property
    def news(self) -> list[str]:
        """What was told, in short."""
        return [what for what, _ in self.told]

    async def report(self, *edges: Edge) -> None:
        """Findings come, and are stored."""
        self.manager.report(edges)
        await self.manager.save()

    async def step(self, seconds: float) -> None:
        """Time passes."""
        self.clock.advance(seconds)
        self.manager.tick()
        await self.manager.save()

    def alert(self, robot: str = "r1") -> Alert:
        """The robot's one alert."""
        (found,) = self.manager.of(robot)
        return found


@asynccontextmanager
async def open_world(
    folder: Path,
    *,
    url: str = "",
    clock: ManualClock | None = None,
    name: str = "data",
    run: bool = False,
    config: AlertConfig | None = None,
    **limits: Any,
) -> AsyncIterator[World]:
    """A desk that was started, closed afterwards as the gateway closes it; with `run` its own tasks run beside."""
    clock = clock or ManualClock(wall_ns=NOW)
    retention = Retention(age_s=1000.0, size_bytes=1 << 30)
    store = Store(folder / name, clock=clock, retention=retention, queue_bytes=1 << 20, url=url)
    store.start()
    events: list[tuple[str, str, Mapping[str, Any]]] = []
    manager = AlertManager(
        store,
        clock=clock,
        emit=lambda kind, robot, data: events.append((kind, robot, data)),
        limits=replace(LIMITS, **limits),
        config=config,
    )
    world = World(manager, store, clock, events=events)
    manager.listen(lambda what, alert: world.told.append((what, alert)))
    await manager.start()
    running = asyncio.create_task(manager.run()) if run else None
    try:
        yield world
    finally:
        if running is not None:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
        await manager.close()
        await store.close()
