"""Many robots in one event loop, what they have in common, and how they come and go."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from random import Random
from typing import Final

from load_tests.fleet.http2 import open_http2
from load_tests.fleet.lanes import OpenLane
from load_tests.fleet.load import Load
from load_tests.fleet.other_lanes import open_aio, open_websocket
from load_tests.fleet.robot import Robot, Shared
from metaros.clock import Clock, SystemClock

__all__ = ["TRANSPORTS", "Simulator"]

TRANSPORTS: Final[Mapping[str, OpenLane]] = {"grpc": open_http2, "aio": open_aio, "ws": open_websocket}
STEP_S: Final = 0.02
MOST_OPENING: Final = 64
OPENING_S: Final = 30.0


class Simulator(Shared):
    """All simulated robots of a run."""

    def __init__(self, *, host: str, port: int, transport: str, rng: Random, clock: Clock | None = None) -> None:
        super().__init__(host=host, port=port, open_lane=TRANSPORTS[transport], rng=rng, clock=clock or SystemClock())
        self.robots: list[Robot] = []

    async def join(self, loads: Sequence[Load], *, per_s: float, prefix: str = "load") -> None:
        """So many robots more, at a rate, and no faster than links come up; returns when each has begun.

        A ramp beyond what the gateway can open is a storm, which is another scenario.
        """
        began, first = self.clock.monotonic_s(), len(self.robots)
        for index, load in enumerate(loads):
            if (early_s := index / per_s - (self.clock.monotonic_s() - began)) > 0:
                await asyncio.sleep(max(early_s, STEP_S))
            await self.until(lambda: len(self.robots) - self.counts.up < MOST_OPENING, timeout_s=OPENING_S)
            robot = Robot(self, f"{prefix}_{first + index + 1:05d}", load)
            self.robots.append(robot)
            robot.start()

    async def until(self, true: Callable[[], bool], *, timeout_s: float) -> bool:
        """Wait for something; False when it did not come in time."""
        end_s = self.clock.monotonic_s() + timeout_s
        while not true():
            if self.clock.monotonic_s() > end_s:
                return False
            await asyncio.sleep(STEP_S)
        return True

    async def all_up(self, *, timeout_s: float) -> bool:
        """Wait until every link is up."""
        return await self.until(lambda: self.counts.up == len(self.robots), timeout_s=timeout_s)

    async def settle(self, *, timeout_s: float) -> bool:
        """No more load, until everything that was handed over is acknowledged."""
        for robot in self.robots:
            robot.stop_load()
        return await self.until(lambda: not any(robot.outbox.waiting for robot in self.robots), timeout_s=timeout_s)

    def stop(self) -> None:
        """All hang up."""
        for robot in self.robots:
            robot.stop()
