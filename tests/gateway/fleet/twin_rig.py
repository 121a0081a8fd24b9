"""A store, the twins of one gateway on it, and model robots that are linked to it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

from gateway.domain.robot import Robot
from gateway.fleet.robots import SendFrame
from gateway.fleet.twins.feature import Twins
from gateway.store import RobotWrite, Store
from gateway.store.retention import Retention
from metaros.clock import SystemClock
from tests.gateway.fleet.twin_robot import ModelFleet, ModelRobot

__all__ = ["Rig", "rig_on", "twins_on"]


class Rig:
    """A store, the twins of one gateway, and model robots linked to it."""

    def __init__(self, store: Store, twins: Twins, fleet: ModelFleet) -> None:
        self.store, self.twins, self.fleet = store, twins, fleet

    async def robot(self, name: str, **labels: str) -> ModelRobot:
        """One that has connected before, and is linked now."""
        self.fleet.add(name, **labels)
        self.store.submit(RobotWrite(Robot(name, labels=labels), 1))
        await self.store.flush()
        return self.link(name)

    def link(self, name: str) -> ModelRobot:
        """A new link, with the report that every agent sends on it."""
        robot = self.fleet.robots[name]
        robot.online, robot.inbox = True, []
        self.twins.on_online(name, True)
        self.twins.on_report(name, robot.report())
        return robot

    def cut(self, name: str) -> None:
        """The link ends."""
        self.fleet.robots[name].online = False
        self.twins.on_online(name, False)

    def read(self, robot: ModelRobot, most: int = 1000) -> None:
        """Let a robot read some of what it was sent."""
        for _ in range(min(most, len(robot.inbox))):
            if robot.take(robot.inbox.pop(0)) and robot.online:
                self.twins.on_report(robot.name, robot.report())

    async def work(self, done: Callable[[], bool]) -> None:
        """Let robots read what they were sent until `done`."""
        async with asyncio.timeout(60):
            while True:
                for robot in self.fleet.robots.values():
                    self.read(robot)
                if done():
                    return
                await asyncio.sleep(0.01)


@asynccontextmanager
async def twins_on(
    url: str, folder: Path, send: SendFrame, said: Callable[[str], Mapping[str, str]]
) -> AsyncIterator[tuple[Store, Twins]]:
    """A gateway's twins on a store, at work. At the end they are gone as after kill -9."""
    retention = Retention(age_s=3600.0, size_bytes=1 << 30)
    store = Store(folder, clock=SystemClock(), retention=retention, queue_bytes=1 << 20, url=url)
    store.start()
    twins = Twins(store, send, said, clock=SystemClock())
    await twins.start()
    running = asyncio.create_task(twins.run())
    try:
        yield store, twins
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await store.close()


@asynccontextmanager
async def rig_on(url: str, folder: Path, fleet: ModelFleet | None = None) -> AsyncIterator[Rig]:
    """The same, with model robots."""
    fleet = fleet or ModelFleet()
    async with twins_on(url, folder, fleet.send, fleet.said) as (store, twins):
        yield Rig(store, twins, fleet)
