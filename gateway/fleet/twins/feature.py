"""Twins as one feature of the gateway: the managers for clients, and the sender to robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gateway.fleet.robots import SendFrame
from gateway.fleet.twins.cache import TwinCache
from gateway.fleet.twins.manager import TwinManager
from gateway.fleet.twins.plan import labels_of
from gateway.fleet.twins.sender import TwinSender
from gateway.fleet.twins.templates import TemplateManager
from gateway.store import Store
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["Twins"]


class Twins:
    """All methods on the event loop; `manager` and `templates` are for the API and for other features."""

    def __init__(
        self, store: Store, send: SendFrame, said: Callable[[str], Mapping[str, str]], *, clock: Clock
    ) -> None:
        """`send` puts a frame on a robot's control lane; `said` are the labels of its last Hello."""
        self._said = said
        self.cache = TwinCache(store)
        self.sender = TwinSender(store, self.cache, send, said, clock=clock)
        self.manager = TwinManager(store, self.cache, self.sender, clock=clock)
        self.templates = TemplateManager(store, self.cache, self.sender, clock=clock)

    async def start(self) -> None:
        """Know what is stored, so that the first report is judged by it."""
        await self.cache.load()

    async def run(self) -> None:
        """Until cancelled."""
        await self.sender.run()

    async def close(self) -> None:
        """Store the reports that came last."""
        await self.cache.save()

    def labels_of(self, robot: str) -> dict[str, str]:
        """The robot's labels: what it said itself, and over it what people gave it."""
        return labels_of(self._said(robot), self.cache.desired.get(robot))

    def on_online(self, robot: str, online: bool) -> None:
        """A robot's link began or ended."""
        self.sender.on_online(robot, online)

    def on_report(self, robot: str, frame: link_pb2.TwinReport) -> None:
        """A robot said what it is."""
        self.sender.on_report(robot, frame)
