"""The tables, as numbered migrations, written once for both databases.

Metric rows live twice in their life, never twice at once: a received batch is inserted as it came into
`metric_batches` together with its stream's watermark; the background merge moves its rows into `metric_chunks` of
about 500 samples a series, deleting the batch in the same transaction. `metric_levels` sums many chunks up. `streams`
holds the watermarks, and is never purged: a watermark is what keeps a sample from being stored twice.
"""

from __future__ import annotations

from dataclasses import dataclass

from gateway.store.migrations.alerts import ALERTS
from gateway.store.migrations.audit import AUDIT
from gateway.store.migrations.commands import COMMANDS
from gateway.store.migrations.deliveries import DELIVERIES
from gateway.store.migrations.events import EVENTS
from gateway.store.migrations.functions import FUNCTIONS
from gateway.store.migrations.idempotency import ONCE
from gateway.store.migrations.invocations import INVOCATIONS
from gateway.store.migrations.leases import LEASES
from gateway.store.migrations.levels import LEVELS
from gateway.store.migrations.recordings import RECORDINGS
from gateway.store.migrations.robot_identity import ROBOT_IDENTITY
from gateway.store.migrations.rollouts import ROLLOUTS
from gateway.store.migrations.rules import RULES
from gateway.store.migrations.segments import SEGMENTS
from gateway.store.migrations.series import SERIES
from gateway.store.migrations.twins import TWINS
from gateway.store.migrations.users import USERS
from gateway.store.migrations.watch_states import WATCH_STATES

__all__ = ["CHUNK_SAMPLES", "MIGRATIONS", "ROW_BYTES", "TABLES", "Dialect", "migration"]

CHUNK_SAMPLES = 500

MIGRATIONS: tuple[str, ...] = (
    """
    CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) {rowless};
    CREATE TABLE robots (
        robot {number},
        id TEXT NOT NULL UNIQUE,
        namespace TEXT NOT NULL,
        hostname TEXT NOT NULL,
        agent_version TEXT NOT NULL,
        labels TEXT NOT NULL,
        first_seen_ns {integer} NOT NULL,
        last_seen_ns {integer} NOT NULL
    );
    CREATE TABLE series (
        series {number},
        robot {integer} NOT NULL REFERENCES robots,
        name TEXT NOT NULL,
        topic TEXT NOT NULL,
        field TEXT NOT NULL,
        UNIQUE (robot, name)
    );
    CREATE TABLE streams (
        robot {integer} NOT NULL REFERENCES robots,
        stream_id {integer} NOT NULL,
        epoch {integer} NOT NULL,
        seq {integer} NOT NULL,
        updated_ns {integer} NOT NULL,
        PRIMARY KEY (robot, stream_id, epoch)
    ) {rowless};
    CREATE TABLE gaps (
        robot {integer} NOT NULL REFERENCES robots,
        stream_id {integer} NOT NULL,
        epoch {integer} NOT NULL,
        from_seq {integer} NOT NULL,
        to_seq {integer} NOT NULL,
        reason TEXT NOT NULL,
        from_ns {integer} NOT NULL,
        to_ns {integer} NOT NULL,
        stored_ns {integer} NOT NULL,
        PRIMARY KEY (robot, stream_id, epoch, from_seq)
    ) {rowless};
    CREATE TABLE metric_batches (
        batch {number},
        robot {integer} NOT NULL REFERENCES robots,
        count {integer} NOT NULL,
        stored_ns {integer} NOT NULL,
        series {blob} NOT NULL,
        stamps {blob} NOT NULL,
        vals {blob} NOT NULL
    );
    CREATE INDEX metric_batches_robot ON metric_batches (robot);
    CREATE TABLE metric_chunks (
        chunk {number},
        series {integer} NOT NULL REFERENCES series,
        first_ns {integer} NOT NULL,
        last_ns {integer} NOT NULL,
        count {integer} NOT NULL,
        stored_ns {integer} NOT NULL,
        stamps {blob} NOT NULL,
        vals {blob} NOT NULL
    );
    CREATE INDEX metric_chunks_range ON metric_chunks (series, last_ns);
    CREATE INDEX metric_chunks_age ON metric_chunks (stored_ns);
    CREATE INDEX metric_chunks_open ON metric_chunks (series) WHERE count < 1000;
    """,
    """
    CREATE TABLE writers (
        robot {integer} NOT NULL REFERENCES robots,
        epoch {integer} NOT NULL,
        writer TEXT NOT NULL,
        PRIMARY KEY (robot, epoch)
    ) {rowless};
    CREATE TABLE channels (
        channel {number},
        robot {integer} NOT NULL REFERENCES robots,
        topic TEXT NOT NULL,
        class TEXT NOT NULL,
        encoding TEXT NOT NULL,
        schema_name TEXT NOT NULL,
        schema_encoding TEXT NOT NULL,
        schema {blob} NOT NULL,
        type_hash TEXT NOT NULL,
        qos TEXT NOT NULL,
        UNIQUE (robot, topic, schema_name, type_hash, encoding, class)
    );
    CREATE TABLE sample_batches (
        batch {number},
        robot {integer} NOT NULL REFERENCES robots,
        stream_id {integer} NOT NULL,
        epoch {integer} NOT NULL,
        first_seq {integer} NOT NULL,
        count {integer} NOT NULL,
        channel {integer} NOT NULL REFERENCES channels,
        event {integer} NOT NULL,
        first_ns {integer} NOT NULL,
        last_ns {integer} NOT NULL,
        receive_ns {integer} NOT NULL,
        stored_ns {integer} NOT NULL,
        stamps {blob} NOT NULL,
        lengths {blob} NOT NULL,
        payload {blob} NOT NULL,
        UNIQUE (robot, stream_id, epoch, first_seq)
    );
    CREATE INDEX sample_batches_range ON sample_batches (channel, last_ns);
    CREATE INDEX sample_batches_age ON sample_batches (event, stored_ns);
    CREATE INDEX gaps_age ON gaps (stored_ns);
    {extra}
    """,
    SEGMENTS,
    SERIES,
    RECORDINGS,
    USERS,
    ROBOT_IDENTITY,
    AUDIT,
    TWINS,
    LEASES,
    COMMANDS,
    ROLLOUTS,
    EVENTS,
    ONCE,
    ALERTS,
    DELIVERIES,
    RULES,
    INVOCATIONS,
    FUNCTIONS,
    WATCH_STATES,
    LEVELS,
)

ROW_BYTES = 100  # what a row of these occupies beside them, with its index entries
# The tables that grow with the data, with the columns that make them large.
TABLES: dict[str, str] = {
    "sample_batches": "length(stamps) + length(lengths) + length(payload)",
    "metric_chunks": "length(stamps) + length(vals)",
    "metric_batches": "length(series) + length(stamps) + length(vals)",
    "metric_levels": "length(cells)",
    "deliveries": "size_bytes",
    "happenings": "size_bytes",
    "invocations": "length(log)",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Dialect:
    """How a database spells what the migrations leave open."""

    number: str
    integer: str
    blob: str
    rowless: str = ""
    extra: str = ""
    append_only: str = ""  # of the audit log


def migration(index: int, dialect: Dialect) -> str:
    """The statements of one migration."""
    return MIGRATIONS[index].format(
        number=dialect.number,
        integer=dialect.integer,
        blob=dialect.blob,
        rowless=dialect.rowless,
        extra=dialect.extra,
        append_only=dialect.append_only,
    )
