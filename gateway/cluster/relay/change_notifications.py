"""What is in the store for another gateway is told it: it would find it by itself, at its next look a moment later."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Protocol

from gateway.cluster.asking import HomeOf
from gateway.cluster.ports import Mesh

__all__ = ["Courier", "Deliver", "Nudges", "Orders", "Recordings"]

ORDERS, MOVED, ASK, STOP, TWINS = "orders.waiting", "orders.moved", "recordings.ask", "recordings.stop", "twins.stored"
MOVED_S = 0.02  # in which what changes is told together
MOVED_MOST = 1000  # commands told at a time; the watchers of further ones look by themselves


class Deliver(Protocol):
    """Durable commands on their way."""

    def deliver(self, robot: str) -> None:
        """Send what waits for the robot, soon."""


class Orders(Protocol):
    """Commands that are kept."""

    waiting: Callable[[str], None]
    moved: Callable[[str], None]

    @property
    def delivery(self) -> Deliver:
        """Those on their way."""

    def changed(self, command_id: str) -> None:
        """One has another state."""


class Recordings(Protocol):
    """Recordings that are asked for, and deleted."""

    waiting: Callable[[str, str, int], None]
    deleted: Callable[[str], None]

    def ask(self, recording_id: str, last_ns: int) -> None:
        """Its robot is linked here, perhaps."""

    def stop(self, recording_id: str) -> None:
        """Nobody wants it any more."""


class Courier(Protocol):
    """Twins on their way to robots."""

    edited: Callable[[], None]

    def look(self) -> None:
        """The store has news."""


class Nudges:
    """Lives on the event loop."""

    def __init__(
        self, mesh: Mesh, orders: Orders, recordings: Recordings, courier: Courier, *, home_of: HomeOf
    ) -> None:
        self._mesh = mesh
        self._home_of = home_of
        self._moved: dict[str, None] = {}
        self._telling: asyncio.TimerHandle | None = None
        orders.waiting = self._order_waits
        orders.moved = self._order_moved
        recordings.waiting = self._recording_waits
        recordings.deleted = lambda recording_id: mesh.tell_all(STOP, recording_id.encode())
        courier.edited = lambda: mesh.tell_all(TWINS, b"")
        mesh.on_tell(ORDERS, lambda sender, payload: orders.delivery.deliver(payload.decode()))
        mesh.on_tell(MOVED, lambda sender, payload: _each(orders.changed, json.loads(payload)))
        mesh.on_tell(ASK, lambda sender, payload: recordings.ask(*json.loads(payload)))
        mesh.on_tell(STOP, lambda sender, payload: recordings.stop(payload.decode()))
        mesh.on_tell(TWINS, lambda sender, payload: courier.look())

    def _order_waits(self, robot: str) -> None:
        if home := self._home_of(robot):
            self._mesh.tell(home, ORDERS, robot.encode())

    def _recording_waits(self, robot: str, recording_id: str, last_ns: int) -> None:
        if home := self._home_of(robot):
            self._mesh.tell(home, ASK, json.dumps([recording_id, last_ns]).encode())

    def _order_moved(self, command_id: str) -> None:
        if len(self._moved) < MOVED_MOST and self._mesh.peers():
            self._moved[command_id] = None
        if self._moved and self._telling is None:
            self._telling = asyncio.get_running_loop().call_later(MOVED_S, self._tell_moved)

    def _tell_moved(self) -> None:
        moved, self._moved, self._telling = list(self._moved), {}, None
        self._mesh.tell_all(MOVED, json.dumps(moved).encode())


def _each(tell: Callable[[str], None], items: list[str]) -> None:
    for item in items:
        tell(item)
