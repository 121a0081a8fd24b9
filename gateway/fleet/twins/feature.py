"""Twins as one part of the gateway: the desks for people, and the courier to robots."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from gateway.fleet.robots import SendFrame
from gateway.fleet.templates import TemplateDesk
from gateway.fleet.twin_book import TwinBook
from gateway.fleet.twin_courier import TwinCourier
from gateway.fleet.twin_plan import labels_of
from gateway.fleet.twins import TwinDesk
from gateway.store import Store
from metaros._proto import link_pb2
from metaros.clock import Clock

__all__ = ["Twins"]


class Twins:
    """All methods on the event loop; `desk` and `templates` are for the API and for other features."""

    def __init__(
        self, store: Store, send: SendFrame, said: Callable[[str], Mapping[str, str]], *, clock: Clock
    ) -> None:
        """`send` puts a frame on a robot's control lane; `said` are the labels of its last Hello."""
        self._said = said
        self.book = TwinBook(store)
        self.courier = TwinCourier(store, self.book, send, said, clock=clock)
        self.desk = TwinDesk(store, self.book, self.courier, clock=clock)
        self.templates = TemplateDesk(store, self.book, self.courier, clock=clock)

    async def start(self) -> None:
        """Know what is stored, so that the first report is judged by it."""
        await self.book.load()

    async def run(self) -> None:
        """Until cancelled."""
        await self.courier.run()

    async def close(self) -> None:
        """Store the reports that came last."""
        await self.book.save()

    def labels_of(self, robot: str) -> dict[str, str]:
        """The robot's labels: what it said itself, and over it what people gave it."""
        return labels_of(self._said(robot), self.book.desired.get(robot))

    def on_online(self, robot: str, online: bool) -> None:
        """A robot's link began or ended."""
        self.courier.on_online(robot, online)

    def on_report(self, robot: str, frame: link_pb2.TwinReport) -> None:
        """A robot said what it is."""
        self.courier.on_report(robot, frame)
