"""Rows from one database to another, whatever kinds they are: both have the tables of the migrations.

What tables there are, their columns, keys and references are read from a database in memory that the migrations have
just made, so that nobody keeps a list of them. Rows go page by page in the order of a key, by the two statements that
every database knows.
"""

from __future__ import annotations

import functools
import sqlite3
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter

from gateway.store.engine import Row, StoreEngine, placeholders
from gateway.store.schema import MIGRATIONS, migration
from gateway.store.sqlite import DIALECT

__all__ = ["Table", "copy_rows", "occupied", "tables"]

PAGE_ROWS = 200
# Rows that may hold messages: a page of them is in memory at once.
PAGES = {"sample_batches": 8, "deliveries": 50, "twin_documents": 50, "metric_batches": 50}


@dataclass(frozen=True, slots=True, kw_only=True)
class Table:
    """One table. `key`: columns that order its rows, each row at a place of its own; `number`: what the database counts
    itself, "" for none; `first`: how many rows a new store has in it.
    """

    name: str
    columns: tuple[str, ...]
    key: tuple[str, ...]
    number: str
    first: int


@functools.cache
def tables() -> tuple[Table, ...]:
    """Every table, those that others refer to first."""
    made = sqlite3.connect(":memory:")
    try:
        for index in range(len(MIGRATIONS)):
            made.executescript(migration(index, DIALECT))
        names = [row[0] for row in made.execute("SELECT name FROM sqlite_master WHERE type = 'table' ORDER BY name")]
        found = {name: _table(made, name) for name in names}
        refers = {name: {row[2] for row in made.execute(f"PRAGMA foreign_key_list({name})")} - {name} for name in names}
    finally:
        made.close()
    return tuple(found[name] for name in TopologicalSorter(refers).static_order())


def occupied(engine: StoreEngine) -> str | None:
    """A table in which there is more than a new store has; None when this is one. Inside a transaction."""
    for table in tables():
        if table.name != "meta" and int(engine.fetch(f"SELECT count(*) FROM {table.name}")[0][0]) > table.first:
            return table.name
    return None


def copy_rows(source: StoreEngine, target: StoreEngine, *, on_table: Callable[[str, int, int], None]) -> int:
    """All rows, in place of those of a new store; how many. Inside a transaction of either engine.

    `on_table` is told each table, its place and how many there are.
    """
    count, every = 0, tables()
    for table in reversed(every):
        if table.first or table.name == "meta":
            target.execute(f"DELETE FROM {table.name}")
    for place, table in enumerate(every, 1):
        on_table(table.name, place, len(every))
        own = " OVERRIDING SYSTEM VALUE" if target.shared and table.number else ""
        put = f"INSERT INTO {table.name} ({', '.join(table.columns)}){own} VALUES ({placeholders(len(table.columns))})"
        for page in _pages(source, table):
            target.many(put, [_plain(row) for row in page] if target.shared else page)
            count += len(page)
        if own:
            target.fetch(
                f"SELECT setval(pg_get_serial_sequence('{table.name}', '{table.number}'),"
                f" coalesce((SELECT max({table.number}) FROM {table.name}), 0) + 1, false)"
            )
    return count


def _pages(source: StoreEngine, table: Table) -> Iterator[Sequence[Row]]:
    limit = PAGES.get(table.name, PAGE_ROWS)
    names, order = ", ".join(table.columns), ", ".join(table.key)
    places = [table.columns.index(name) for name in table.key]
    last: tuple[object, ...] = ()
    while True:
        where = f" WHERE ({order}) > ({placeholders(len(last))})" if last else ""
        page = source.fetch(f"SELECT {names} FROM {table.name}{where} ORDER BY {order} LIMIT {limit}", *last)
        if page:
            yield [tuple(row) for row in page]
            last = tuple(page[-1][place] for place in places)
        if len(page) < limit:
            return


def _plain(row: Row) -> Row:
    """As PostgreSQL takes it: it knows no NUL in a text."""
    return tuple(value.replace("\0", "\ufffd") if isinstance(value, str) else value for value in row)


def _table(made: sqlite3.Connection, name: str) -> Table:
    columns = made.execute(f"PRAGMA table_info({name})").fetchall()
    key = [row[1] for row in sorted(columns, key=lambda row: row[5]) if row[5]]
    return Table(
        name=name,
        columns=tuple(row[1] for row in columns),
        key=tuple(key) or _unique(made, name),
        number=key[0] if len(key) == 1 and _counts(name, key[0]) else "",
        first=int(made.execute(f"SELECT count(*) FROM {name}").fetchone()[0]),
    )


def _unique(made: sqlite3.Connection, name: str) -> tuple[str, ...]:
    """The columns of a constraint that makes rows unique, where there is no primary key."""
    for _, index, unique, origin, *_ in made.execute(f"PRAGMA index_list({name})").fetchall():
        if unique and origin == "u":
            return tuple(row[2] for row in made.execute(f"PRAGMA index_info({index})"))
    raise ValueError(f"the table {name} has no key by which its rows could be copied")


def _counts(table: str, column: str) -> bool:
    """Whether the database numbers this column itself."""
    return any(
        f"CREATE TABLE {table} (" in text and f"{column} {{number}}" in _body(text, table) for text in MIGRATIONS
    )


def _body(text: str, table: str) -> str:
    return text.partition(f"CREATE TABLE {table} (")[2].partition(";")[0]
