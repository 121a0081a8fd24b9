"""Some gateways on one PostgreSQL, as far as watching goes: stores, desks of alerts and watches, one clock for all."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import AsyncIterator, Iterable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from gateway.alerting.alerts.manager import AlertManager
from gateway.alerting.anomaly.config import EvaluatorConfig
from gateway.alerting.anomaly.detectors.lasting import LastingConfig
from gateway.alerting.watch.ownership import Ownership
from gateway.alerting.watch.state_machine import StateMachine
from gateway.alerting.watch.watch import Watch
from gateway.domain.alert import Alert, AlertFilter
from gateway.domain.channel import Series
from gateway.domain.finding import Edge
from gateway.domain.sample import Rows
from gateway.fleet.presence import Presence
from gateway.store import Store
from gateway.store.retention import Retention
from gateway.store.writes import StreamWrite
from metaros.clock import ManualClock, SystemClock

__all__ = ["START_S", "Replica", "Replicas", "open_replicas"]

START_S = 1_700_000_000
CONFIG = EvaluatorConfig(lasting=LastingConfig(learn_s=40, epoch_s=20))
SERIES = (Series("imu.x", "/imu", "x"), Series("left.motor_temperature.temperature", "/left/motor", "temperature"))
EPOCH = 7


def rows_of(robot: str, second: int, number: int, *, shift: float = 0.0) -> StreamWrite:
    """Four rows of each of two series within one second, by the robot's clock; the `number`th write of the robot."""
    rng = np.random.default_rng([sum(robot.encode()), second])
    values = (rng.normal(size=(4, 2)) * (0.2, 0.5) + (shift, 40.0 + shift)).ravel()
    stamps = np.repeat(START_S * 10**9 + second * 10**9 + np.arange(4) * 250_000_000, 2)
    rows = Rows(SERIES, np.tile(np.arange(2, dtype=np.uint32), 4), stamps, values)
    return StreamWrite(robot=robot, stream_id=0, epoch=EPOCH, seq=8 * number, rows=rows)


@dataclass
class Replica:
    """One gateway; it is its own whereabouts."""

    name: str
    world: Replicas
    store: Store
    manager: AlertManager
    watch: Watch
    presence: Presence
    told: list[tuple[str, Alert]] = field(default_factory=list)
    edges: list[Edge] = field(default_factory=list)
    alive: bool = True

    @property
    def ownership(self) -> Ownership:
        found = self.watch._ownership
        assert found is not None
        return found

    async def step(self) -> None:
        """What its loops do within a second."""
        await self.presence.look()
        await self.ownership.step()
        for robot in self.world.linked(self.name):
            self.watch.facts.heartbeat(robot)
        await self.watch.run_cycle()
        self.manager.tick()
        await self.manager.save()
        await self.manager.refresh()

    async def stored(self) -> None:
        """What came is in the store, and the watch was told."""
        await self.store.flush()
        await asyncio.sleep(0)  # the listener is told behind the flush


@dataclass
class Replicas:
    """`home` says where each robot is linked; `second` is that of all clocks."""

    clock: ManualClock
    by_name: dict[str, Replica] = field(default_factory=dict)
    home: dict[str, str] = field(default_factory=dict)
    second: int = 0
    sent: Counter[str] = field(default_factory=Counter)

    def submit(self, robot: str, name: str, *, second: int, shift: float = 0.0) -> None:
        """The robot's rows of a second come to a gateway."""
        self.sent[robot] += 1
        self.by_name[name].store.submit(rows_of(robot, second, self.sent[robot], shift=shift))

    def linked(self, name: str) -> list[str]:
        return sorted(robot for robot, home in self.home.items() if home == name)

    def link(self, robot: str, name: str) -> None:
        """The robot's link goes from where it was to a gateway, or nowhere."""
        before, self.home[robot] = self.home.get(robot, ""), name
        for gateway, up in ((before, False), (name, True)):
            if gateway in self.by_name and self.by_name[gateway].alive:
                one = self.by_name[gateway]
                one.presence.on_online(robot)
                one.watch.facts.add("link", robot, up, self.now_s)

    @property
    def now_s(self) -> float:
        return self.clock.wall_ns() / 1e9

    async def run(self, seconds: int, *, robots: Iterable[str] = ("r1",), shift: float = 0.0, at_once: int = 1) -> None:
        """Robots send to where they are linked, then every gateway that lives has its turn; each a second."""
        for start in range(0, seconds, at_once):
            some = min(at_once, seconds - start)
            for robot in robots:
                if home := self.home.get(robot):
                    for second in range(self.second, self.second + some):
                        self.submit(robot, home, second=second, shift=shift)
                    await self.by_name[home].stored()
            self.second += some
            self.clock.advance(some)
            living = [one for one in self.by_name.values() if one.alive]
            for one in living:
                await one.presence.publish()
            for one in living:
                await one.step()

    async def alerts(self) -> list[Alert]:
        """All of the store."""
        one = next(one for one in self.by_name.values() if one.alive)
        return await one.manager.list(AlertFilter(), limit=100)

    def judges(self, robot: str) -> list[str]:
        """Who judges a robot."""
        return [name for name, one in self.by_name.items() if one.alive and one.watch.judges(robot)]

    def opened(self) -> Counter[tuple[str, str]]:
        """How often each alert (robot, cause) was told as opened, by all gateways."""
        told = [alert for one in self.by_name.values() for what, alert in one.told if what == "opened"]
        return Counter((alert.robot, alert.cause) for alert in told)

    def judged(self, name: str, robot: str = "r1") -> dict[str, tuple[float, ...]]:
        """What a gateway's evaluator says of a robot's series."""
        evaluator = self.by_name[name].watch._evaluation.state_machine.evaluator
        return {
            series: (evaluator.score(slot), *evaluator.band(slot), *evaluator.learned(slot))
            for series, slot in evaluator.series(robot)
        }


@dataclass
class Where:
    """Where robots are, for one of them."""

    world: Replicas
    name: str

    def local(self) -> Sequence[str]:
        return self.world.linked(self.name)

    def is_remote(self, robot: str) -> bool:
        return self.world.home.get(robot, "") != self.name and self.world.by_name[self.name].presence.of(robot)[0]

    def expected(self, robot: str) -> bool:
        return True


@asynccontextmanager
async def open_replicas(folder: Path, url: str, *names: str) -> AsyncIterator[Replicas]:
    """Each is closed as a gateway closes it, but those that are not `alive`: of them only the store is."""
    world = Replicas(ManualClock(wall_ns=START_S * 10**9))
    async with AsyncExitStack() as stack:
        for name in names:
            await stack.enter_async_context(replica(world, folder, url, name))
        yield world


@asynccontextmanager
async def replica(world: Replicas, folder: Path, url: str, name: str) -> AsyncIterator[Replica]:
    async def no_clip(alert: Alert) -> Any:
        raise AssertionError("nobody asks for a clip")

    retention = Retention(age_s=1e9, size_bytes=1 << 40)
    store = Store(folder / name, clock=SystemClock(), retention=retention, queue_bytes=1 << 24, url=url)
    clock = world.clock
    manager = AlertManager(store, clock=clock)
    made: Replica

    def report(edges: Sequence[Edge]) -> None:
        made.edges += edges
        manager.report(edges)

    watch = Watch(
        folder / name / "watch",
        store,
        clock=clock,
        report=report,
        clip=no_clip,
        make=lambda: StateMachine(config=CONFIG),
        where=Where(world, name),
        gained=manager.adopt,
        lost=manager.release,
    )
    presence = Presence(store, lambda robot: (world.home.get(robot) == name, world.clock.wall_ns()), clock=clock)
    made = world.by_name[name] = Replica(name, world, store, manager, watch, presence)
    manager.listen(lambda what, alert: made.told.append((what, alert)))
    store.start(watch.on_committed, None, watch.ahead)
    await manager.start(adopt=False)
    await watch.start()
    await watch.ensure_evaluated([alert.robot for alert in manager.known()])
    await watch.begin()
    try:
        yield made
    finally:
        if made.alive:
            await watch.close()
            await manager.close()
        else:
            watch._evaluation.stop = True
            watch._thread.shutdown()
        await store.close()
