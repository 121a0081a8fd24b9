"""What the queue needs of the store."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

from gateway.store.engine import StoreEngine

__all__ = ["Database", "read_snapshot"]

Result = TypeVar("Result")


class Database(Protocol):
    """The store."""

    @property
    def shared(self) -> bool:
        """Whether other gateways write to it."""

    @property
    def gateway_id(self) -> str:
        """Who writes here."""

    async def run(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job in one write transaction."""

    async def read(self, job: Callable[[StoreEngine], Result]) -> Result:
        """A job that reads, in a transaction of its own making."""


async def read_snapshot(database: Database, job: Callable[[StoreEngine], Result]) -> Result:
    """A job that reads, at a single moment."""

    def within_one(engine: StoreEngine) -> Result:
        with engine.transaction(write=False):
            return job(engine)

    return await database.read(within_one)
