"""The robots of all gateways of one store in each of them: what is told of those here, and known of those elsewhere."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

from gateway.cluster.mirror_away import Elsewhere, MirrorAway
from gateway.cluster.mirror_home import LOOK_S, MirrorHome
from gateway.cluster.ports import Mesh
from gateway.ingest.registry import Registry
from gateway.live.hub import Hub
from metaros.clock import Clock

__all__ = ["Mirror"]


class Mirror:
    """All methods on the event loop; made before the mesh starts."""

    def __init__(self, mesh: Mesh, registry: Registry, hub: Hub, *, clock: Clock, look_s: float = LOOK_S) -> None:
        """What changes all the time is told every `look_s`."""
        self._home = MirrorHome(mesh, registry, clock=clock, look_s=look_s)
        self._away = MirrorAway(mesh, registry, hub, clock=clock)

    @property
    def mirrored(self) -> int:
        """How many robots are linked elsewhere."""
        return self._away.mirrored

    def of(self, gateway: str) -> list[str]:
        """The robots that are linked to another gateway, by its id."""
        return self._away.of(gateway)

    def watch(self, callback: Callable[[str], None]) -> Callable[[], None]:
        """Be told, by its id, of each robot whose home or channels there are news; returns what ends that."""
        return self._away.watch(callback)

    def on_elsewhere(self, callback: Elsewhere) -> None:
        """Who ends the link of a robot here when a newer session of it is at another gateway."""
        self._away.on_elsewhere = callback

    def on_orphan(self, callback: Callable[[str], None]) -> None:
        """Who says of a robot that it went offline when its home died: one of the gateways that live is asked."""
        self._away.on_orphan = callback

    def on_online(self, robot: str, online: bool) -> None:
        """A robot's link to this gateway came or went."""
        self._home.on_online(robot, online)
        self._away.on_online(robot, online)

    def on_channels(self, robot: str) -> None:
        """Something was announced here."""
        self._home.on_channels(robot)

    def on_values(self, robot: str, values: Mapping[str, tuple[int, float]]) -> None:
        """Newest values of series came here."""
        self._home.on_values(robot, values)

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._home.run())
            group.create_task(self._away.run())
