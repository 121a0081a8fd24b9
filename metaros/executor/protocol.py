"""What an executor needs of a node, and what everybody may expect of an executor."""

from __future__ import annotations

from typing import Protocol

from metaros.clock import Clock
from metaros.executor.ingress import Ingress
from metaros.executor.timers import TimerHeap

__all__ = ["Executor", "Spinnable"]


class Spinnable(Protocol):
    """A node as an executor sees it. Nodes of one context share one ingress."""

    @property
    def ingress(self) -> Ingress:
        """Where its arrivals come in."""

    @property
    def timers(self) -> TimerHeap:
        """Its timers."""

    @property
    def clock(self) -> Clock:
        """The clock of its timers."""

    @property
    def closed(self) -> bool:
        """Whether it left the graph."""


class Executor(Protocol):
    """Runs the callbacks of nodes."""

    def add_node(self, node: Spinnable) -> None:
        """Run this node's callbacks, too."""

    def remove_node(self, node: Spinnable) -> None:
        """Run them no more."""

    def spin(self) -> None:
        """Run callbacks until `shutdown`."""

    def spin_once(self, timeout_s: float | None = None) -> bool:
        """Run what is ready, waiting up to `timeout_s` for something; False when nothing came."""

    def shutdown(self) -> None:
        """Make `spin` return; safe from any thread and from signal handlers."""
