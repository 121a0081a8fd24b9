"""What the agent needs to know of signed bundles.

Whoever fetches and checks bundles (edge_agent.update) gives an object of `Bundles`: what it returns was signed, is on
the disk as a whole, has its environment, and never changes again.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Protocol

__all__ = ["Bundle", "Bundles"]


class Bundle(Protocol):
    """A bundle on the disk; `argv` runs it."""

    @property
    def folder(self) -> Path:
        """Where it is."""

    @property
    def argv(self) -> tuple[str, ...]:
        """Its program and arguments; none of a container."""

    @property
    def engine(self) -> str:
        """The program that runs its image, where it is a container."""

    @property
    def image(self) -> str:
        """Of a container: what its engine knows it by."""


class Bundles(Protocol):
    """The bundles of this robot."""

    def ready(self, name: str, version: str) -> Bundle | None:
        """A bundle that is here and complete."""

    async def get(self, name: str, version: str) -> Bundle:
        """The same, fetched where it is not here. Raises MetarosError."""

    def did_well(self, name: str, version: str) -> None:
        """A node of it has proved itself."""

    def collect(self, keep: Iterable[tuple[str, str]]) -> object:
        """These are in use; others may go."""
