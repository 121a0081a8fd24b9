"""Robots' presence: whether they have a link, at this gateway or at another one of the store."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from gateway.errors import StoreError
from gateway.store import Store
from gateway.store.engine import StoreEngine
from gateway.store.fleet.presence import forget_gateway, read_presence, say_alive, write_presence
from metaros.clock import Clock

__all__ = ["Presence"]

log = logging.getLogger(__name__)

STEP_S = 1.0
ALIVE_NS = 10 * 10**9  # for so long a gateway that says nothing is believed to live
Here = Callable[[str], tuple[bool, int]]


class Presence:
    """All methods on the event loop. A gateway that has its store for itself neither writes nor reads any of it."""

    def __init__(self, store: Store, here: Here, *, clock: Clock) -> None:
        """`here`: whether a robot is linked to this gateway, and since when it is or is not (wall time, ns)."""
        self._store = store
        self._here = here
        self._clock = clock
        self._changed: set[str] = set()
        self._remote: dict[str, tuple[bool, int]] = {}
        self._begun = False

    def on_online(self, robot: str) -> None:
        """The robot's link to this gateway came or went."""
        self._changed.add(robot)

    def of(self, robot: str) -> tuple[bool, int]:
        """Whether the robot is online anywhere, and since when it is or is not, as of the last `look`."""
        here, remote = self._here(robot), self._remote.get(robot, (False, 0))
        return here if here[0] else max(remote, here)

    def is_here(self, robot: str) -> bool:
        """Whether it is linked to this very gateway."""
        return self._here(robot)[0]

    async def look(self) -> None:
        """Learn where other gateways' robots are. StoreError when the store cannot be asked."""
        if self._store.shared:
            now_ns = self._clock.wall_ns()

            def job(engine: StoreEngine) -> dict[str, tuple[bool, int]]:
                with engine.transaction(write=False):
                    return read_presence(engine, self._store.gateway_id, now_ns=now_ns)

            self._remote = await self._store.read(job)

    async def publish(self) -> None:
        """Tell other gateways what changed here, and that this one lives."""
        if not self._store.shared:
            self._changed.clear()
            return
        now_ns, begun, said = self._clock.wall_ns(), self._begun, self._changed
        self._changed, now = set(), {robot: self._here(robot) for robot in said}

        def job(engine: StoreEngine) -> None:
            if not begun:
                forget_gateway(engine, self._store.gateway_id, now_ns=now_ns)
            say_alive(engine, self._store.gateway_id, until_ns=now_ns + ALIVE_NS)
            write_presence(engine, self._store.gateway_id, now)

        try:
            await self._store.run(job)
        except StoreError:
            self._changed |= said
            raise
        self._begun = True

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            try:
                await self.publish()
            except StoreError as error:
                log.debug("other gateways do not hear where robots are: %s", error)
            await asyncio.sleep(STEP_S)

    async def close(self) -> None:
        """This gateway ends, and its links with it."""
        if self._store.shared:
            now_ns = self._clock.wall_ns()
            await self._store.run(lambda engine: forget_gateway(engine, self._store.gateway_id, now_ns=now_ns))
