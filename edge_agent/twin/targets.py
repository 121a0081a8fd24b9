"""Interfaces that a twin's sections are applied to: the robot's nodes, and its agent's version."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

__all__ = ["AgentVersion", "NoNodes", "NodeTable", "SameVersion"]


class NodeTable(Protocol):
    """The nodes that the robot runs."""

    changed: Callable[[], None]  # called when `reported` or `handed_over` changes

    @property
    def handed_over(self) -> bool:
        """Whether what runs nodes has been given what is wanted, or cannot be given it now."""

    async def set_nodes(self, nodes: Mapping[str, Any] | None) -> None:
        """Run these and no others; None: the twin says nothing of nodes. A MetarosError changes nothing."""

    def reported(self) -> dict[str, Any]:
        """The nodes as they are, by name."""


class AgentVersion(Protocol):
    """The program that this is."""

    changed: Callable[[], None]

    async def want(self, version: str | None) -> None:
        """Become this version; None: stay. Returns at once, and says in `reported` what comes of it."""

    def reported(self) -> dict[str, Any]:
        """Version, slot, and how an update stands."""


class NoNodes:
    """An agent without a supervisor."""

    def __init__(self) -> None:
        self.changed: Callable[[], None] = lambda: None
        self.handed_over = True

    async def set_nodes(self, nodes: Mapping[str, Any] | None) -> None:
        """Nothing is run."""

    def reported(self) -> dict[str, Any]:
        """None."""
        return {}


class SameVersion:
    """An agent that cannot update itself."""

    def __init__(self, version: str) -> None:
        self.changed: Callable[[], None] = lambda: None
        self._version = version

    async def want(self, version: str | None) -> None:
        """It stays what it is."""

    def reported(self) -> dict[str, Any]:
        """Its version."""
        return {"version": self._version, "slot": "", "update": {"state": "off"}}
