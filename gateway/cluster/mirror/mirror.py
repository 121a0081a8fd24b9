"""Mirrors robots between the gateways of one store: sends the state of local ones, keeps that of remote ones."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping

from gateway.cluster.mirror.receiver import MirrorReceiver, OnRemoteSession
from gateway.cluster.mirror.sender import LOOK_S, MirrorSender
from gateway.cluster.ports import Mesh
from gateway.ingest.registry import Registry
from gateway.live.hub import Hub
from metaros.clock import Clock

__all__ = ["Mirror"]


class Mirror:
    """All methods on the event loop; made before the mesh starts."""

    def __init__(self, mesh: Mesh, registry: Registry, hub: Hub, *, clock: Clock, look_s: float = LOOK_S) -> None:
        """Values and counts are sent every `look_s`."""
        self._sender = MirrorSender(mesh, registry, clock=clock, look_s=look_s)
        self._receiver = MirrorReceiver(mesh, registry, hub, clock=clock)

    @property
    def mirrored(self) -> int:
        """How many robots are linked to other gateways."""
        return self._receiver.mirrored

    def of(self, gateway: str) -> list[str]:
        """The robots that are linked to another gateway, by its id."""
        return self._receiver.of(gateway)

    def watch(self, callback: Callable[[str], None]) -> Callable[[], None]:
        """Call back with the id of each robot whose owner or channels changed; returns what ends that."""
        return self._receiver.watch(callback)

    def on_remote_session(self, callback: OnRemoteSession) -> None:
        """Who ends the link of a robot here when a newer session of it is at another gateway."""
        self._receiver.on_remote_session = callback

    def on_orphan(self, callback: Callable[[str], None]) -> None:
        """Who says of a robot that it went offline when its owner died: one of the gateways that live is asked."""
        self._receiver.on_orphan = callback

    def on_online(self, robot: str, online: bool) -> None:
        """A robot's link to this gateway came or went."""
        self._sender.on_online(robot, online)
        self._receiver.on_online(robot, online)

    def on_channels(self, robot: str) -> None:
        """Something was announced here."""
        self._sender.on_channels(robot)

    def on_values(self, robot: str, values: Mapping[str, tuple[int, float]]) -> None:
        """Newest values of series came here."""
        self._sender.on_values(robot, values)

    async def run(self) -> None:
        """Until cancelled."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._sender.run())
            group.create_task(self._receiver.run())
