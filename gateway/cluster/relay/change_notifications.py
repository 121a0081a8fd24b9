"""Notifies other gateways of changes in the shared store, which they would otherwise find at their next poll."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Protocol

from gateway.cluster.owner_request import OwnerOf
from gateway.cluster.ports import Mesh

__all__ = ["ChangeNotifications", "Delivery", "Orders", "Recordings", "TwinSync"]

ORDERS, MOVED, ASK, STOP, TWINS = "orders.waiting", "orders.moved", "recordings.ask", "recordings.stop", "twins.stored"
MOVED_S = 0.02  # changes within so long are sent together
MOVED_MOST = 1000  # commands in a message; watchers of further ones poll


class Delivery(Protocol):
    """Durable commands on their way."""

    def deliver(self, robot: str) -> None:
        """Send what waits for the robot, soon."""


class Orders(Protocol):
    """Commands that are kept."""

    waiting: Callable[[str], None]
    moved: Callable[[str], None]

    @property
    def delivery(self) -> Delivery:
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


class TwinSync(Protocol):
    """Twins on their way to robots."""

    edited: Callable[[], None]

    def look(self) -> None:
        """The store has news."""


class ChangeNotifications:
    """Lives on the event loop."""

    def __init__(
        self, mesh: Mesh, command_manager: Orders, recordings: Recordings, twin_sync: TwinSync, *, owner_of: OwnerOf
    ) -> None:
        self._mesh = mesh
        self._owner_of = owner_of
        self._moved: dict[str, None] = {}
        self._telling: asyncio.TimerHandle | None = None
        command_manager.waiting = self._order_waits
        command_manager.moved = self._order_moved
        recordings.waiting = self._recording_waits
        recordings.deleted = lambda recording_id: mesh.broadcast(STOP, recording_id.encode())
        twin_sync.edited = lambda: mesh.broadcast(TWINS, b"")
        mesh.on_message(ORDERS, lambda sender, payload: command_manager.delivery.deliver(payload.decode()))
        mesh.on_message(MOVED, lambda sender, payload: _each(command_manager.changed, json.loads(payload)))
        mesh.on_message(ASK, lambda sender, payload: recordings.ask(*json.loads(payload)))
        mesh.on_message(STOP, lambda sender, payload: recordings.stop(payload.decode()))
        mesh.on_message(TWINS, lambda sender, payload: twin_sync.look())

    def _order_waits(self, robot: str) -> None:
        if owner := self._owner_of(robot):
            self._mesh.send(owner, ORDERS, robot.encode())

    def _recording_waits(self, robot: str, recording_id: str, last_ns: int) -> None:
        if owner := self._owner_of(robot):
            self._mesh.send(owner, ASK, json.dumps([recording_id, last_ns]).encode())

    def _order_moved(self, command_id: str) -> None:
        if len(self._moved) < MOVED_MOST and self._mesh.peers():
            self._moved[command_id] = None
        if self._moved and self._telling is None:
            self._telling = asyncio.get_running_loop().call_later(MOVED_S, self._report_moved)

    def _report_moved(self) -> None:
        moved, self._moved, self._telling = list(self._moved), {}, None
        self._mesh.broadcast(MOVED, json.dumps(moved).encode())


def _each(send: Callable[[str], None], items: list[str]) -> None:
    for item in items:
        send(item)
