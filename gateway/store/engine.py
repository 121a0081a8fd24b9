"""The database interface of the store, implemented for SQLite and PostgreSQL.

An engine is one connection, used by one thread. Everything is asked inside a transaction, and refused outside of one:
a job that forgot it would work on SQLite, and on PostgreSQL as long as its thread has a connection of an earlier job.
The statements are written once, with `?` for values, in the SQL that both understand.

Whatever goes wrong is a StoreError, and nothing of the transaction is kept, with one exception that no database can
avoid: when the connection breaks during a COMMIT, nobody knows. Therefore every commit compares its samples with the
watermarks that the database has by then.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager
from itertools import islice
from typing import Any, Protocol, TypeVar
from urllib.parse import urlsplit

__all__ = ["Row", "StoreEngine", "placeholders", "shown", "signed", "slices", "unsigned"]

Row = Sequence[Any]
Item = TypeVar("Item")
SLICE = 256  # values of one IN list


class StoreEngine(Protocol):
    """One connection to the database of a store."""

    shared: bool  # others may write to the same database
    for_update: str  # ends a SELECT whose rows nobody else may change until the transaction is over

    def open(self) -> str:
        """Bring the tables up to date; the store's id, made once for the store's whole life."""

    def reader(self) -> StoreEngine:
        """Another connection, for reading."""

    def transaction(self, *, write: bool) -> AbstractContextManager[None]:
        """Everything inside it happens or nothing does; one that only reads sees a single moment."""

    def fetch(self, sql: str, *values: Any) -> Sequence[Row]:
        """A query's rows; StoreError outside of a transaction."""

    def execute(self, sql: str, *values: Any) -> int:
        """One statement; how many rows it changed. StoreError outside of a transaction."""

    def many(self, sql: str, rows: Sequence[Row]) -> None:
        """One statement for each of many rows; StoreError outside of a transaction."""

    def vacuum(self) -> None:
        """Give back some of the space of deleted rows, where the database does not do that itself; outside of a
        transaction.
        """

    def used_bytes(self) -> int:
        """What the stored data occupies."""

    def close(self) -> None:
        """Let the connection go."""


def shown(url: str) -> str:
    """A store's URL without its password and options."""
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}{parts.path}"


def placeholders(count: int) -> str:
    """That many `?`, for an IN list."""
    return ", ".join("?" * count)


def slices(items: Sequence[Item]) -> Iterator[list[Item]]:
    """The items in lists of a few sizes only (the last item is repeated), so that statements can be kept prepared."""
    rest = iter(items)
    while piece := list(islice(rest, SLICE)):
        size = 1 << (len(piece) - 1).bit_length()
        yield [*piece, *[piece[-1]] * (size - len(piece))]


def signed(number: int) -> int:
    """An unsigned 64-bit number as a database's signed integer."""
    return number - (1 << 64) if number >= 1 << 63 else number


def unsigned(number: int) -> int:
    """The reverse of `signed`."""
    return number + (1 << 64) if number < 0 else number
