"""The default engine: one SQLite file in the gateway's data directory, which no other gateway may use."""

from __future__ import annotations

import contextlib
import secrets
import sqlite3
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from gateway.errors import StoreError, UnstorableError
from gateway.store.engine import Row
from gateway.store.schema import MIGRATIONS, Dialect, migration

__all__ = ["DATABASE", "SqliteEngine"]

DATABASE = "gateway.sqlite"
DIALECT = Dialect(
    number="INTEGER PRIMARY KEY",
    integer="INTEGER",
    blob="BLOB",
    rowless="WITHOUT ROWID",
    append_only="".join(
        f"CREATE TRIGGER audit_no_{verb} BEFORE {verb} ON audit"
        " BEGIN SELECT RAISE(ABORT, 'the audit log is append-only'); END;"
        for verb in ("update", "delete")
    ),
)


class SqliteEngine:
    """A connection in autocommit mode (transactions are explicit); the writer's syncs every commit."""

    shared = False
    for_update = ""

    def __init__(self, data_dir: Path, *, read_only: bool = False) -> None:
        self._data_dir = data_dir
        uri = f"{(data_dir / DATABASE).absolute().as_uri()}{'?mode=ro' if read_only else ''}"
        with _store_errors():
            self.connection = sqlite3.connect(
                uri, uri=True, isolation_level=None, check_same_thread=False, timeout=5.0, cached_statements=256
            )
            if not read_only:
                self.connection.execute("PRAGMA auto_vacuum = INCREMENTAL")
                self.connection.execute("PRAGMA journal_mode = WAL")
                self.connection.execute("PRAGMA synchronous = FULL")
            self.connection.execute("PRAGMA cache_size = -16384")

    def open(self) -> str:
        """Bring the tables up to date; the store's id."""
        with _store_errors():
            version = int(self.connection.execute("PRAGMA user_version").fetchone()[0])
            if version > len(MIGRATIONS):
                raise StoreError(
                    f"the store has schema {version}, this program knows {len(MIGRATIONS)}: use a newer program"
                )
            if version < len(MIGRATIONS):
                # In one transaction: a new store waits for the disk once, not once a migration.
                steps = "".join(migration(index, DIALECT) for index in range(version, len(MIGRATIONS)))
                self.connection.executescript(f"BEGIN; {steps} PRAGMA user_version = {len(MIGRATIONS)}; COMMIT;")
            self.connection.execute("INSERT OR IGNORE INTO meta VALUES ('store_id', ?)", (secrets.token_hex(16),))
            return str(self.connection.execute("SELECT value FROM meta WHERE key = 'store_id'").fetchone()[0])

    def reader(self) -> SqliteEngine:
        """Another connection, for reading."""
        return SqliteEngine(self._data_dir, read_only=True)

    @contextlib.contextmanager
    def transaction(self, *, write: bool) -> Iterator[None]:
        """All or nothing; one that only reads sees a single moment."""
        with _store_errors():
            self.connection.execute("BEGIN IMMEDIATE" if write else "BEGIN")
            try:
                yield
                self.connection.execute("COMMIT")
            except BaseException:
                if self.connection.in_transaction:
                    self.connection.execute("ROLLBACK")
                raise

    def fetch(self, sql: str, *values: Any) -> Sequence[Row]:
        """A query's rows."""
        with _store_errors():
            return self._inside().execute(sql, values).fetchall()

    def execute(self, sql: str, *values: Any) -> int:
        """One statement; how many rows it changed."""
        with _store_errors():
            return self._inside().execute(sql, values).rowcount

    def many(self, sql: str, rows: Sequence[Row]) -> None:
        """One statement for each of many rows."""
        with _store_errors():
            self._inside().executemany(sql, rows)

    def vacuum(self) -> None:
        """Give some free pages back to the file system."""
        with _store_errors():
            # Each step frees one page, and `execute` takes one step of what has no columns.
            self.connection.executescript("PRAGMA incremental_vacuum(256)")

    def used_bytes(self) -> int:
        """What the rows occupy: the file's pages without the free ones."""
        with _store_errors():
            pages, free, size = (
                int(self.connection.execute(f"PRAGMA {name}").fetchone()[0])
                for name in ("page_count", "freelist_count", "page_size")
            )
        return (pages - free) * size

    def close(self) -> None:
        """Let the connection go."""
        self.connection.close()

    def _inside(self) -> sqlite3.Connection:
        if not self.connection.in_transaction:
            raise StoreError("no transaction is open")
        return self.connection


@contextlib.contextmanager
def _store_errors() -> Iterator[None]:
    try:
        yield
    except (OverflowError, sqlite3.IntegrityError, sqlite3.InterfaceError, sqlite3.ProgrammingError) as error:
        raise UnstorableError(str(error)) from error
    except sqlite3.Error as error:
        raise StoreError(str(error)) from error
