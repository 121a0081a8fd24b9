"""PostgreSQL as the store, where several gateways may share one database.

The driver is asynchronous, the store's threads are not: every engine runs a little event loop of its own. A connection
on which anything failed is given up, and the next transaction makes a new one; so the engine comes back by itself
after PostgreSQL was restarted or unreachable.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import secrets
from collections.abc import Coroutine, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, TypeVar

import asyncpg

from gateway.errors import StoreError, UnstorableError
from gateway.store.engine import Row, shown
from gateway.store.schema import MIGRATIONS, ROW_BYTES, TABLES, Dialect, migration

__all__ = ["PostgresEngine"]

log = logging.getLogger(__name__)
Result = TypeVar("Result")

DIALECT = Dialect(
    number="BIGINT GENERATED ALWAYS AS IDENTITY PRIMARY KEY",
    integer="BIGINT",
    blob="BYTEA",
    # Sensor data is compressed by its makers or not at all; its sizes are then read without its content.
    extra="".join(
        f"ALTER TABLE {table} ALTER {column} SET STORAGE EXTERNAL;"
        for table, columns in (
            ("sample_batches", ("stamps", "lengths", "payload")),
            ("metric_chunks", ("stamps", "vals")),
            ("metric_batches", ("series", "stamps", "vals")),
        )
        for column in columns
    ),
    append_only=(
        "CREATE FUNCTION audit_refuse() RETURNS trigger LANGUAGE plpgsql AS"
        " $$ BEGIN RAISE EXCEPTION 'the audit log is append-only'; END $$;"
        "CREATE TRIGGER audit_append_only BEFORE UPDATE OR DELETE OR TRUNCATE ON audit"
        " FOR EACH STATEMENT EXECUTE FUNCTION audit_refuse();"
    ),
)
CONNECT_S = 3.0
STATEMENT_S = 10.0
MIGRATION_LOCK = 0x6D657461  # "meta"
# A gateway that hangs must not hold its robots' rows for ever.
SETTINGS = {"application_name": "metaros-gateway", "idle_in_transaction_session_timeout": "30s", "lock_timeout": "8s"}


class PostgresEngine:
    """One connection; made when it is first needed, and again after it broke."""

    shared = True
    for_update = " FOR NO KEY UPDATE"

    def __init__(self, url: str, *, read_only: bool = False, store_id: str = "") -> None:
        self._url = url
        self._read_only = read_only
        self._store_id = store_id
        self._loop = asyncio.new_event_loop()
        self._connection: asyncpg.Connection[asyncpg.Record] | None = None

    def open(self) -> str:
        """Bring the tables up to date; the store's id."""
        with self.transaction(write=True):
            self.fetch("SELECT pg_advisory_xact_lock(?)", MIGRATION_LOCK)  # two gateways may start at once
            self._statements("CREATE TABLE IF NOT EXISTS metaros_schema (version BIGINT NOT NULL)")
            version = int(self.fetch("SELECT coalesce(max(version), 0) FROM metaros_schema")[0][0])
            if version > len(MIGRATIONS):
                raise StoreError(
                    f"the store has schema {version}, this program knows {len(MIGRATIONS)}: use a newer program"
                )
            for index in range(version, len(MIGRATIONS)):
                self._statements(migration(index, DIALECT))
                self.execute("INSERT INTO metaros_schema VALUES (?)", index + 1)
            insert = "INSERT INTO meta VALUES ('store_id', ?) ON CONFLICT (key) DO NOTHING"
            self.execute(insert, secrets.token_hex(16))
            store_id = str(self.fetch("SELECT value FROM meta WHERE key = 'store_id'")[0][0])
            if self.fetch("SHOW fsync")[0][0] == "off":
                log.warning("PostgreSQL runs with fsync = off: a power cut loses what robots believe is stored")
        self._store_id = store_id
        return store_id

    def reader(self) -> PostgresEngine:
        """Another connection, for reading."""
        return PostgresEngine(self._url, read_only=True, store_id=self._store_id)

    @contextlib.contextmanager
    def transaction(self, *, write: bool) -> Iterator[None]:
        """All or nothing; one that only reads sees a single moment.

        Raises:
            StoreError: it failed; when the connection broke during the COMMIT it may have happened all the same.
        """
        begin = "BEGIN" if write else "BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY"
        with _store_errors():
            try:
                self._begin(begin)
                yield
                if self._statements("COMMIT") != "COMMIT":
                    raise StoreError("PostgreSQL rolled the transaction back")
            except BaseException:
                self._drop()
                raise

    def fetch(self, sql: str, *values: Any) -> Sequence[Row]:
        """A query's rows."""
        with _store_errors():
            return list(self._run(self._inside().fetch(_numbered(sql), *values)))

    def execute(self, sql: str, *values: Any) -> int:
        """One statement; how many rows it changed."""
        with _store_errors():
            status: str = self._run(self._inside().execute(_numbered(sql), *values))
        last = status.rpartition(" ")[2]
        return int(last) if last.isdigit() else 0

    def many(self, sql: str, rows: Sequence[Row]) -> None:
        """One statement for each of many rows, in one round trip."""
        with _store_errors():
            connection = self._inside()
            if rows:
                self._run(connection.executemany(_numbered(sql), rows))

    def vacuum(self) -> None:
        """Nothing: PostgreSQL does that itself."""

    def used_bytes(self) -> int:
        """What the rows hold; the files are larger until they are vacuumed, and their space is used again."""
        with self.transaction(write=False):
            sizes = [
                f"(SELECT coalesce(sum({size} + {ROW_BYTES}), 0)::BIGINT FROM {table})"
                for table, size in TABLES.items()
            ]
            return int(self.fetch(f"SELECT {' + '.join(sizes)}")[0][0])

    def close(self) -> None:
        """Let the connection go."""
        self._drop()
        self._loop.close()

    def _begin(self, statement: str) -> None:
        """Begin on the living connection, or on a new one."""
        if self._connection is not None:
            try:
                self._statements(statement)
                return
            except _FAULTS:
                self._drop()
        self._connection = self._run(self._connect())
        self._statements(statement)

    async def _connect(self) -> asyncpg.Connection[asyncpg.Record]:
        connection = await asyncpg.connect(
            self._url, timeout=CONNECT_S, command_timeout=STATEMENT_S, server_settings=SETTINGS
        )
        # What is acknowledged is on the disk, whatever the database's default is; a stronger setting stays.
        await connection.execute(
            "SELECT set_config('synchronous_commit', 'on', false) WHERE current_setting('synchronous_commit') = 'off'"
        )
        if self._store_id:
            found = await connection.fetchval("SELECT value FROM meta WHERE key = 'store_id'")
            if found != self._store_id:
                connection.terminate()
                raise StoreError(f"{shown(self._url)} is store {found} now, it was {self._store_id}")
        return connection

    def _inside(self) -> asyncpg.Connection[asyncpg.Record]:
        if self._connection is None or not self._connection.is_in_transaction():
            raise StoreError("no transaction is open")
        return self._connection

    def _statements(self, text: str) -> str:
        """Statements in one go, also those that begin and end a transaction."""
        if self._connection is None:
            raise StoreError("no transaction is open")
        status: str = self._run(self._connection.execute(text))
        return status

    def _run(self, work: Coroutine[Any, Any, Result]) -> Result:
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return self._loop.run_until_complete(work)
        with ThreadPoolExecutor(1) as thread:  # the gateway opens and closes its store inside its own event loop
            return thread.submit(self._loop.run_until_complete, work).result()

    def _drop(self) -> None:
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.terminate()
            self._run(asyncio.sleep(0))  # lets the transport close


_FAULTS = (
    asyncpg.PostgresError,
    asyncpg.InterfaceError,
    asyncpg.InternalClientError,  # what the driver says of a connection that a killed server left half way
    OSError,
    TimeoutError,
    asyncio.TimeoutError,
)


@contextlib.contextmanager
def _store_errors() -> Iterator[None]:
    try:
        yield
    except (asyncpg.DataError, asyncpg.IntegrityConstraintViolationError) as error:
        raise UnstorableError(str(error)) from error
    except _FAULTS as error:
        raise StoreError(f"PostgreSQL: {error or type(error).__name__}") from error


@functools.lru_cache(maxsize=512)
def _numbered(sql: str) -> str:
    """`?` becomes `$1`, `$2`, and so on."""
    pieces = sql.split("?")
    return "".join(f"{piece}${number}" for number, piece in enumerate(pieces[:-1], 1)) + pieces[-1]
