"""Finding stored messages: which runs there are, in batches and in segments, always of one moment.

A run is in `sample_batches` or in `segment_runs`, and compaction moves it in one transaction; a question that asks
both inside one transaction therefore sees each run exactly once.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from gateway.domain.channel import Channel
from gateway.domain.sample import Gap
from gateway.store.engine import Row, StoreEngine, placeholders, signed, slices, unsigned
from gateway.store.samples import CHANNEL_COLUMNS, RUN_COLUMNS, SampleFilter, StoredRun, stored_channel, stored_run

__all__ = ["StoredTopic", "TopicGap", "find_runs", "gaps_between", "newest_candidates", "stored_topics", "topic_names"]

_BATCH = f"SELECT {RUN_COLUMNS}, length(b.payload) AS size_bytes, {{none}} FROM sample_batches b"
_RUN = (
    f"SELECT {RUN_COLUMNS}, b.size_bytes, s.object, b.chunk_start, b.chunk_bytes, b.place"
    " FROM segment_runs b JOIN segments s ON s.segment = b.segment"
)
_NONE = (
    "CAST(NULL AS TEXT) AS object, CAST(NULL AS BIGINT) AS chunk_start, CAST(NULL AS BIGINT) AS chunk_bytes,"
    " CAST(NULL AS BIGINT) AS place"
)
_BOTH = (_BATCH.format(none=_NONE), _RUN)
_LOST_TOPIC = (
    "SELECT c.topic, c.class FROM {table} b JOIN channels c ON c.channel = b.channel"
    " WHERE b.robot = ? AND b.stream_id = ? AND b.epoch = ? ORDER BY b.first_seq DESC LIMIT 1"
)


@dataclass(frozen=True, slots=True)
class StoredTopic:
    """What is stored of one topic under one type and delivery class; `size_bytes` counts payloads."""

    topic: str
    schema_name: str
    delivery: str
    samples: int
    size_bytes: int
    first_ns: int
    last_ns: int


@dataclass(frozen=True, slots=True)
class TopicGap:
    """A declared loss with the topic of its stream: "" for metric rows and for a stream that left nothing else."""

    stream_id: int
    epoch: int
    gap: Gap
    stored_ns: int
    topic: str
    delivery: str


def find_runs(
    engine: StoreEngine, robot_id: str, wanted: SampleFilter, *, limit: int, newest_first: bool = False
) -> list[StoredRun]:
    """The robot's runs that hold anything of what is wanted, at most `limit`, in order of their keys.

    They come by their lowest stamp; with `newest_first` by their highest one, descending.
    """
    key = f"({'last_ns' if newest_first else 'first_ns'}, stream_id, epoch, first_seq)"
    direction = " DESC" if newest_first else ""
    order = ", ".join(column + direction for column in key.strip("()").split(", "))
    with engine.transaction(write=False):
        channels = _channels(engine, robot_id, wanted)
        if not channels:
            return []
        where, values = _conditions(wanted, newest_first=newest_first)
        names = f"b.channel IN ({placeholders(len(channels))})"
        halves = [f"{half} WHERE {' AND '.join([names, *where])}" for half in _BOTH]
        both = f"SELECT * FROM ({halves[0]} UNION ALL {halves[1]}) AS runs ORDER BY {order} LIMIT ?"
        rows = engine.fetch(both, *channels, *values, *channels, *values, limit)
    return [stored_run(channels[row[0]], row) for row in rows]


def newest_candidates(engine: StoreEngine, robot_id: str, topic: str, t_ns: int) -> list[StoredRun]:
    """Runs one of which holds the topic's newest sample at or before `t_ns`; none of them when there is no such one.

    The newest run that ended by then comes first, if there is any, then those that go on after it, newest begin first.
    """
    with engine.transaction(write=False):
        channels = _channels(engine, robot_id, SampleFilter(topic=topic))
        if not channels:
            return []
        names = f"b.channel IN ({placeholders(len(channels))})"
        ended = [f"{half} WHERE {names} AND b.last_ns <= ? ORDER BY b.last_ns DESC LIMIT 1" for half in _BOTH]
        before = [row for half in ended for row in engine.fetch(half, *channels, t_ns)]
        across = [f"{half} WHERE {names} AND b.last_ns > ? AND b.first_ns <= ?" for half in _BOTH]
        rows = [row for half in across for row in engine.fetch(half, *channels, t_ns, t_ns)]
    runs = sorted((stored_run(channels[row[0]], row) for row in rows), key=lambda run: -run.first_ns)
    last = max((stored_run(channels[row[0]], row) for row in before), key=lambda run: run.last_ns, default=None)
    return [last, *runs] if last is not None else runs


def stored_topics(engine: StoreEngine, robot_id: str) -> list[StoredTopic]:
    """Every topic of which messages are stored, by name."""
    sums = (
        "channel, sum(count) AS samples, sum({size}) AS size_bytes, min(first_ns) AS first_ns, max(last_ns) AS last_ns"
    )
    query = (
        "SELECT c.topic, c.schema_name, c.class, CAST(sum(h.samples) AS BIGINT), CAST(sum(h.size_bytes) AS BIGINT),"
        " min(h.first_ns), max(h.last_ns) FROM ("
        f"SELECT {sums.format(size='length(payload)')} FROM sample_batches WHERE robot = ? GROUP BY channel"
        f" UNION ALL SELECT {sums.format(size='size_bytes')} FROM segment_runs WHERE robot = ? GROUP BY channel"
        ") AS h JOIN channels c ON c.channel = h.channel"
        " GROUP BY c.topic, c.schema_name, c.class ORDER BY c.topic, c.schema_name, c.class"
    )
    with engine.transaction(write=False):
        robot = _robot(engine, robot_id)
        rows = engine.fetch(query, robot, robot) if robot is not None else []
    return [StoredTopic(*row) for row in rows]


def topic_names(engine: StoreEngine, robot_id: str) -> list[str]:
    """Every topic of which messages were ever stored, by name; cheap, however many there are."""
    query = "SELECT DISTINCT topic FROM channels JOIN robots USING (robot) WHERE id = ? ORDER BY topic"
    with engine.transaction(write=False):
        return [row[0] for row in engine.fetch(query, robot_id)]


def gaps_between(engine: StoreEngine, robot_id: str, *, start_ns: int, end_ns: int, limit: int) -> list[TopicGap]:
    """The robot's declared losses that touch the time between two stamps, the newest first."""
    query = (
        "SELECT stream_id, epoch, from_seq, to_seq, reason, from_ns, to_ns, stored_ns FROM gaps"
        " WHERE robot = ? AND to_ns >= ? AND from_ns <= ? ORDER BY to_ns DESC, stream_id, epoch, from_seq LIMIT ?"
    )
    with engine.transaction(write=False):
        robot = _robot(engine, robot_id)
        rows = engine.fetch(query, robot, start_ns, end_ns, limit) if robot is not None else []
        streams = {(row[0], row[1]) for row in rows}
        topics = {stream: _topic(engine, robot, *stream) for stream in sorted(streams)}
    return [TopicGap(row[0], unsigned(row[1]), Gap(*row[2:7]), row[7], *topics[row[0], row[1]]) for row in rows]


def _robot(engine: StoreEngine, robot_id: str) -> int | None:
    rows = engine.fetch("SELECT robot FROM robots WHERE id = ?", robot_id)
    return int(rows[0][0]) if rows else None


def _channels(engine: StoreEngine, robot_id: str, wanted: SampleFilter) -> dict[int, Channel]:
    """The channels whose runs may be wanted, by number."""
    find = f"SELECT {CHANNEL_COLUMNS} FROM channels c JOIN robots r ON r.robot = c.robot WHERE r.id = ?"
    if wanted.topic is None and wanted.topics is None:
        rows = list(engine.fetch(find, robot_id))
    else:
        names = set(wanted.topics) if wanted.topics is not None else {str(wanted.topic)}
        if wanted.topic is not None:
            names &= {wanted.topic}
        rows = [
            row
            for some in slices(sorted(names))
            for row in engine.fetch(f"{find} AND c.topic IN ({placeholders(len(some))})", robot_id, *some)
        ]
    return {row[0]: stored_channel(robot_id, row) for row in rows}


def _conditions(wanted: SampleFilter, *, newest_first: bool) -> tuple[list[str], list[Any]]:
    """What a run must be, for either table."""
    pairs: list[tuple[str, list[Any]]] = []
    if wanted.stream_id is not None:
        pairs.append(("b.stream_id = ?", [wanted.stream_id]))
    if wanted.epoch is not None:
        pairs.append(("b.epoch = ?", [signed(wanted.epoch)]))
    if wanted.first_seq:
        pairs.append(("b.first_seq + b.count > ?", [wanted.first_seq]))
    if wanted.start_ns is not None:
        pairs.append(("b.last_ns >= ?", [wanted.start_ns]))
    if wanted.end_ns is not None:
        pairs.append(("b.first_ns <= ?", [wanted.end_ns]))
    if wanted.after is not None:
        stamp, sign = ("b.last_ns", "<") if newest_first else ("b.first_ns", ">")
        first_ns, stream_id, epoch, first_seq = wanted.after
        key = f"({stamp}, b.stream_id, b.epoch, b.first_seq) {sign} (?, ?, ?, ?)"
        pairs.append((key, [first_ns, stream_id, signed(epoch), first_seq]))
    return [condition for condition, _ in pairs], [value for _, some in pairs for value in some]


def _topic(engine: StoreEngine, robot: int | None, stream_id: int, epoch: int) -> tuple[str, str]:
    """The topic and class of what a stream left; two empty texts when it left nothing."""
    rows: list[Row] = []
    for table in ("sample_batches", "segment_runs"):
        rows += engine.fetch(_LOST_TOPIC.format(table=table), robot, stream_id, epoch)
    return (rows[0][0], rows[0][1]) if rows else ("", "")
