"""How far event source mappings have read the streams of robots. Every function runs inside a caller's transaction."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass

from gateway.store.engine import StoreEngine, placeholders, signed, slices, unsigned
from gateway.store.telemetry.samples import CHANNEL_COLUMNS, RUN_COLUMNS, StoredRun, stored_channel, stored_run

__all__ = ["Cursor", "Stream", "find_streams", "forget_mapping", "next_runs", "put_cursor", "read_cursors", "start_of"]

_BATCHES = f"SELECT {RUN_COLUMNS}, length(b.payload), NULL, NULL, NULL, NULL FROM sample_batches b"
_RUNS = (
    f"SELECT {RUN_COLUMNS}, b.size_bytes, s.object, b.chunk_start, b.chunk_bytes, b.place"
    " FROM segment_runs b JOIN segments s ON s.segment = b.segment"
)
_NEXT = (
    " WHERE b.robot = (SELECT robot FROM robots WHERE id = ?) AND b.stream_id = ? AND b.epoch = ?"
    " AND b.first_seq + b.count > ? AND b.stored_ns >= ? ORDER BY b.first_seq LIMIT ?"
)
_PUT = """
    INSERT INTO mapping_cursors VALUES (?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (mapping, robot, stream_id, epoch) DO UPDATE SET seq = excluded.seq, tries = excluded.tries,
        most_seq = excluded.most_seq, updated_ns = excluded.updated_ns WHERE mapping_cursors.seq <= excluded.seq
"""


@dataclass(frozen=True, slots=True, order=True)
class Stream:
    """One stream of a robot since its agent's store began."""

    robot: str
    stream_id: int
    epoch: int


@dataclass(frozen=True, slots=True)
class Cursor:
    """`seq` is the newest number that is done with. `tries` failed of the batch that follows; it does not reach beyond
    `most_seq` (0: no bound), as it was split.
    """

    seq: int
    tries: int = 0
    most_seq: int = 0


def start_of(engine: StoreEngine, mapping: str, *, now_ns: int) -> int:
    """When a mapping began to read, ns since the epoch: now, where it has not before."""
    engine.execute("INSERT INTO mapping_starts VALUES (?, ?) ON CONFLICT (mapping) DO NOTHING", mapping, now_ns)
    return int(engine.fetch("SELECT started_ns FROM mapping_starts WHERE mapping = ?", mapping)[0][0])


def read_cursors(engine: StoreEngine, mapping: str) -> dict[Stream, Cursor]:
    """How far a mapping is, by stream."""
    rows = engine.fetch(
        "SELECT robot, stream_id, epoch, seq, tries, most_seq FROM mapping_cursors WHERE mapping = ?", mapping
    )
    return {Stream(row[0], row[1], unsigned(row[2])): Cursor(row[3], row[4], row[5]) for row in rows}


def put_cursor(engine: StoreEngine, mapping: str, stream: Stream, cursor: Cursor, *, now_ns: int) -> None:
    """It is so far; never back, whoever else reads for the mapping."""
    place = (mapping, stream.robot, stream.stream_id, signed(stream.epoch))
    engine.execute(_PUT, *place, cursor.seq, cursor.tries, cursor.most_seq, now_ns)


def forget_mapping(engine: StoreEngine, mappings: Collection[str]) -> int:
    """Forget how far all mappings were but these; how many were forgotten."""
    known = [row[0] for row in engine.fetch("SELECT mapping FROM mapping_starts")]
    gone = [mapping for mapping in known if mapping not in mappings]
    for table in ("mapping_cursors", "mapping_starts"):
        engine.many(f"DELETE FROM {table} WHERE mapping = ?", [(mapping,) for mapping in gone])
    return len(gone)


def find_streams(
    engine: StoreEngine, wanted: Callable[[str, str], bool], *, stored_ns: int, whole: bool = True
) -> list[tuple[Stream, str]]:
    """The streams of which something was stored since, with their topics, where robot and topic are wanted.

    Not `whole`: what lies in segments already is not looked for.
    """
    rows = engine.fetch("SELECT c.channel, r.id, c.topic FROM channels c JOIN robots r ON r.robot = c.robot")
    channels = {row[0]: (row[1], row[2]) for row in rows if wanted(row[1], row[2])}
    found: dict[Stream, str] = {}
    for some in slices(list(channels)):
        for table in ("sample_batches", "segment_runs")[: 1 + whole]:
            sql = (
                f"SELECT DISTINCT channel, stream_id, epoch FROM {table}"
                f" WHERE channel IN ({placeholders(len(some))}) AND stored_ns >= ?"
            )
            for channel, stream_id, epoch in engine.fetch(sql, *some, stored_ns):
                robot, topic = channels[channel]
                found[Stream(robot, stream_id, unsigned(epoch))] = topic
    return sorted(found.items())


def next_runs(engine: StoreEngine, stream: Stream, *, after: int, stored_ns: int, limit: int) -> Sequence[StoredRun]:
    """What follows a number of a stream and was stored since, in order of the numbers; at most `limit` runs."""
    key = (stream.robot, stream.stream_id, signed(stream.epoch), after + 1, stored_ns, limit)
    rows = [*engine.fetch(_BATCHES + _NEXT, *key), *engine.fetch(_RUNS + _NEXT, *key)]
    rows.sort(key=lambda row: int(row[3]))
    numbers = sorted({row[0] for row in rows})
    find = f"SELECT {CHANNEL_COLUMNS} FROM channels c WHERE c.channel IN ({placeholders(len(numbers))})"
    channels = {row[0]: stored_channel(stream.robot, row) for row in (engine.fetch(find, *numbers) if numbers else ())}
    return [stored_run(channels[row[0]], row) for row in rows[:limit]]
