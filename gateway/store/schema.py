"""The database's tables, as numbered migrations, and how a connection to it is opened.

Metric rows live twice in their life, never twice at once: a received batch is inserted as it came into
`metric_batches` together with its stream's watermark; the background merge moves its rows into `metric_chunks` of
about 1000 samples a series, deleting the batch in the same transaction.
"""

from __future__ import annotations

import secrets
import sqlite3
from pathlib import Path

from gateway.errors import StoreError

__all__ = ["CHUNK_SAMPLES", "DATABASE", "MIGRATIONS", "connect", "migrate", "signed", "unsigned"]

DATABASE = "gateway.sqlite"
CHUNK_SAMPLES = 1000

MIGRATIONS: tuple[str, ...] = (
    """
    CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
    CREATE TABLE robots (
        robot INTEGER PRIMARY KEY,
        id TEXT NOT NULL UNIQUE,
        namespace TEXT NOT NULL,
        hostname TEXT NOT NULL,
        agent_version TEXT NOT NULL,
        labels TEXT NOT NULL,
        first_seen_ns INTEGER NOT NULL,
        last_seen_ns INTEGER NOT NULL
    );
    CREATE TABLE series (
        series INTEGER PRIMARY KEY,
        robot INTEGER NOT NULL REFERENCES robots,
        name TEXT NOT NULL,
        topic TEXT NOT NULL,
        field TEXT NOT NULL,
        UNIQUE (robot, name)
    );
    CREATE TABLE streams (
        robot INTEGER NOT NULL REFERENCES robots,
        stream_id INTEGER NOT NULL,
        epoch INTEGER NOT NULL,
        seq INTEGER NOT NULL,
        updated_ns INTEGER NOT NULL,
        PRIMARY KEY (robot, stream_id, epoch)
    ) WITHOUT ROWID;
    CREATE TABLE gaps (
        robot INTEGER NOT NULL REFERENCES robots,
        stream_id INTEGER NOT NULL,
        epoch INTEGER NOT NULL,
        from_seq INTEGER NOT NULL,
        to_seq INTEGER NOT NULL,
        reason TEXT NOT NULL,
        from_ns INTEGER NOT NULL,
        to_ns INTEGER NOT NULL,
        stored_ns INTEGER NOT NULL,
        PRIMARY KEY (robot, stream_id, epoch, from_seq)
    ) WITHOUT ROWID;
    CREATE TABLE metric_batches (
        batch INTEGER PRIMARY KEY,
        robot INTEGER NOT NULL REFERENCES robots,
        count INTEGER NOT NULL,
        stored_ns INTEGER NOT NULL,
        series BLOB NOT NULL,
        stamps BLOB NOT NULL,
        vals BLOB NOT NULL
    );
    CREATE INDEX metric_batches_robot ON metric_batches (robot);
    CREATE TABLE metric_chunks (
        chunk INTEGER PRIMARY KEY,
        series INTEGER NOT NULL REFERENCES series,
        first_ns INTEGER NOT NULL,
        last_ns INTEGER NOT NULL,
        count INTEGER NOT NULL,
        stored_ns INTEGER NOT NULL,
        stamps BLOB NOT NULL,
        vals BLOB NOT NULL
    );
    CREATE INDEX metric_chunks_range ON metric_chunks (series, last_ns);
    CREATE INDEX metric_chunks_age ON metric_chunks (stored_ns);
    CREATE INDEX metric_chunks_open ON metric_chunks (series) WHERE count < 1000;
    """,
    """
    CREATE TABLE writers (
        robot INTEGER NOT NULL REFERENCES robots,
        epoch INTEGER NOT NULL,
        writer TEXT NOT NULL,
        PRIMARY KEY (robot, epoch)
    ) WITHOUT ROWID;
    CREATE TABLE channels (
        channel INTEGER PRIMARY KEY,
        robot INTEGER NOT NULL REFERENCES robots,
        topic TEXT NOT NULL,
        class TEXT NOT NULL,
        encoding TEXT NOT NULL,
        schema_name TEXT NOT NULL,
        schema_encoding TEXT NOT NULL,
        schema BLOB NOT NULL,
        type_hash TEXT NOT NULL,
        qos TEXT NOT NULL,
        UNIQUE (robot, topic, schema_name, type_hash, encoding, class)
    );
    CREATE TABLE sample_batches (
        batch INTEGER PRIMARY KEY,
        robot INTEGER NOT NULL REFERENCES robots,
        stream_id INTEGER NOT NULL,
        epoch INTEGER NOT NULL,
        first_seq INTEGER NOT NULL,
        count INTEGER NOT NULL,
        channel INTEGER NOT NULL REFERENCES channels,
        first_ns INTEGER NOT NULL,
        last_ns INTEGER NOT NULL,
        receive_ns INTEGER NOT NULL,
        stored_ns INTEGER NOT NULL,
        stamps BLOB NOT NULL,
        lengths BLOB NOT NULL,
        payload BLOB NOT NULL,
        UNIQUE (robot, stream_id, epoch, first_seq)
    );
    CREATE INDEX sample_batches_range ON sample_batches (channel, last_ns);
    CREATE INDEX sample_batches_age ON sample_batches (stored_ns);
    """,
)


def connect(data_dir: Path, *, read_only: bool = False) -> sqlite3.Connection:
    """A connection in autocommit mode (transactions are explicit); the writer's syncs every commit."""
    uri = f"file:{data_dir / DATABASE}{'?mode=ro' if read_only else ''}"
    connection = sqlite3.connect(uri, uri=True, isolation_level=None, check_same_thread=False, timeout=5.0)
    if not read_only:
        connection.execute("PRAGMA auto_vacuum = INCREMENTAL")
        connection.execute("PRAGMA journal_mode = WAL")
        connection.execute("PRAGMA synchronous = FULL")
    connection.execute("PRAGMA cache_size = -16384")
    return connection


def migrate(connection: sqlite3.Connection) -> str:
    """Bring the tables up to date and return the store's id, made once for the store's whole life."""
    version = int(connection.execute("PRAGMA user_version").fetchone()[0])
    if version > len(MIGRATIONS):
        raise StoreError(f"the store has schema {version}, this program knows {len(MIGRATIONS)}: use a newer program")
    for number in range(version, len(MIGRATIONS)):
        connection.executescript(f"BEGIN; {MIGRATIONS[number]} PRAGMA user_version = {number + 1}; COMMIT;")
    connection.execute("INSERT OR IGNORE INTO meta VALUES ('store_id', ?)", (secrets.token_hex(16),))
    return str(connection.execute("SELECT value FROM meta WHERE key = 'store_id'").fetchone()[0])


def signed(number: int) -> int:
    """An unsigned 64-bit number as SQLite's signed integer."""
    return number - (1 << 64) if number >= 1 << 63 else number


def unsigned(number: int) -> int:
    """The reverse of `signed`."""
    return number + (1 << 64) if number < 0 else number
