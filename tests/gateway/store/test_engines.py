"""What holds of either engine: nothing is asked of it outside of a transaction."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from gateway.errors import StoreError, UnstorableError
from gateway.store.engine import StoreEngine
from gateway.store.sqlite import SqliteEngine

INSERT = "INSERT INTO meta VALUES (?, ?)"
COUNT = "SELECT count(*) FROM meta WHERE key = 'k'"
ASKS: dict[str, Callable[[StoreEngine], Any]] = {
    "fetch": lambda engine: engine.fetch(COUNT),
    "execute": lambda engine: engine.execute(INSERT, "k", "v"),
    "many": lambda engine: engine.many(INSERT, [("k", "v")]),
    "many of nothing": lambda engine: engine.many(INSERT, []),
}


def count(engine: StoreEngine) -> int:
    with engine.transaction(write=False):
        return int(engine.fetch(COUNT)[0][0])


def refuse_all(engine: StoreEngine) -> None:
    for ask in ASKS.values():
        with pytest.raises(StoreError, match="no transaction is open"):
            ask(engine)


def test_a_new_reader_and_one_that_has_its_connection_refuse_alike(engine: StoreEngine) -> None:
    reader = engine.reader()
    try:
        refuse_all(reader)
        assert count(reader) == 0
        refuse_all(reader)
    finally:
        reader.close()


def test_the_writer_refuses_before_and_after_a_transaction(engine: StoreEngine) -> None:
    refuse_all(engine)
    with engine.transaction(write=True):
        assert engine.execute(INSERT, "k", "v") == 1
        engine.many(INSERT, [])
    refuse_all(engine)
    assert count(engine) == 1


def test_nothing_follows_a_transaction_that_failed(engine: StoreEngine) -> None:
    with pytest.raises(UnstorableError), engine.transaction(write=True):
        engine.many(INSERT, [("k", "v"), ("k", "v")])
    refuse_all(engine)
    assert count(engine) == 0


def test_space_is_given_back_outside_of_a_transaction(engine: StoreEngine) -> None:
    with engine.transaction(write=True):
        engine.many(INSERT, [(f"k{number}", "v" * 4000) for number in range(1000)])
    with engine.transaction(write=True):
        engine.execute("DELETE FROM meta WHERE value LIKE 'v%'")
    pages = free_pages(engine)
    engine.vacuum()
    assert free_pages(engine) == max(0, pages - 256)
    refuse_all(engine)


def free_pages(engine: StoreEngine) -> int:
    """Those of the file that nothing is in; PostgreSQL does not tell."""
    if not isinstance(engine, SqliteEngine):
        return 0
    return int(engine.connection.execute("PRAGMA freelist_count").fetchone()[0])
