"""What the watch needs of the store."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from gateway.store.engine import StoreEngine

__all__ = ["Database"]

Result = TypeVar("Result")


class Database(Protocol):
    """A part of `gateway.store.Store`."""

    @property
    def shared(self) -> bool:
        """Whether other gateways write there."""

    @property
    def gateway_id(self) -> str:
        """Who writes here."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """Read in a thread."""

    async def read_slowly(self, job: Callable[[StoreEngine], Result]) -> Result:
        """The same, behind nobody's page."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """Write in a transaction."""
