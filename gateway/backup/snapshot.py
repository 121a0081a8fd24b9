"""A consistent snapshot of the database as an SQLite file, also where the database is PostgreSQL.

SQLite copies its own pages inside one reading transaction; PostgreSQL's rows are read inside one that sees a single
moment. Nobody who writes waits for either, and no tool of the database is needed. What is kept in the one can be
restored into the other.
"""

from __future__ import annotations

import contextlib
import os
import sqlite3
from collections.abc import Callable
from pathlib import Path

from gateway.backup.tables import copy_rows
from gateway.errors import StoreError
from gateway.store.engine import StoreEngine, shown
from gateway.store.engines import check_url
from gateway.store.schema import MIGRATIONS
from gateway.store.sqlite import DATABASE, SqliteEngine
from metaros.errors import ConfigError

__all__ = ["facts_of", "open_existing", "settle", "snapshot"]

STEP_PAGES = 4096  # 16 MiB

OnStep = Callable[[str, int, int], None]  # what, how much is done, of how much


def open_existing(url: str, folder: Path) -> StoreEngine:
    """The database as it is: nothing in it is made or brought up to date.

    Raises:
        ConfigError: there is none.
    """
    check_url(url)
    if not url:
        if not (folder / DATABASE).exists():
            raise ConfigError(f"there is no store in {folder}\nSay where the gateway keeps it: --data-dir, or --store.")
        return SqliteEngine(folder)
    from gateway.store.postgres import PostgresEngine

    return PostgresEngine(url)


def facts_of(engine: StoreEngine, where: str) -> tuple[str, int]:
    """The store's id, and how many migrations it has had. ConfigError where that is not as many as we know."""
    with engine.transaction(write=False):
        version = "SELECT max(version) FROM metaros_schema" if engine.shared else "PRAGMA user_version"
        try:
            schema = int(engine.fetch(version)[0][0] or 0)
            store_id = str(engine.fetch("SELECT value FROM meta WHERE key = 'store_id'")[0][0])
        except (StoreError, IndexError) as error:
            raise ConfigError(f"there is no gateway's store at {shown(where) if engine.shared else where}") from error
    if schema != len(MIGRATIONS):
        raise ConfigError(
            f"the store has schema {schema}, this program is made for {len(MIGRATIONS)}\n"
            "Take its backup with the program that its gateway runs."
        )
    return store_id, schema


def snapshot(engine: StoreEngine, folder: Path, *, on_step: OnStep) -> Path:
    """The database of this moment as a file in `folder`, where there is none yet.

    Raises:
        StoreError: the database cannot be read, or the file not be written.
    """
    path = folder / DATABASE
    os.close(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600))
    if isinstance(engine, SqliteEngine):
        _copy_pages(engine, path, on_step)
    else:
        copy = SqliteEngine(folder)
        try:
            copy.open()
            with engine.transaction(write=False), copy.transaction(write=True):
                copy_rows(engine, copy, on_table=on_step)
        finally:
            copy.close()
    settle(path)
    return path


def settle(path: Path) -> None:
    """One file with everything in it, on the disk."""
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as copy:
        copy.execute("PRAGMA journal_mode = DELETE")
    with path.open("rb+") as file:
        os.fsync(file.fileno())


def _copy_pages(engine: SqliteEngine, path: Path, on_step: OnStep) -> None:
    reader = engine.reader()
    try:
        with contextlib.closing(sqlite3.connect(path)) as copy, reader.transaction(write=False):
            reader.fetch("SELECT count(*) FROM meta")  # the moment is now: what others commit does not begin it anew
            reader.connection.backup(
                copy, pages=STEP_PAGES, progress=lambda _, left, total: on_step("pages", total - left, total)
            )
    except sqlite3.Error as error:
        raise StoreError(f"the database cannot be copied: {error}") from error
    finally:
        reader.close()
