"""Finding stored messages: which runs there are, in batches and in segments, always of one moment.

A run is in `sample_batches` or in `segment_runs`, and compaction moves it in one transaction; a question that asks
both inside one transaction therefore sees each run exactly once.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from typing import Any

from gateway.domain.channel import Channel
from gateway.domain.sample import Gap
from gateway.store.engine import Row, StoreEngine, placeholders, signed, slices, unsigned
from gateway.store.telemetry.samples import (
    CHANNEL_COLUMNS,
    RUN_COLUMNS,
    SampleFilter,
    StoredRun,
    stored_channel,
    stored_run,
)

__all__ = [
    "StoredTopic",
    "TopicGap",
    "find_runs",
    "gaps_between",
    "newest_candidates",
    "stored_channels",
    "stored_topics",
    "topic_names",
]

_BATCHES = f"""
    SELECT {RUN_COLUMNS}, length(b.payload) AS size_bytes, NULL, NULL, NULL, NULL FROM sample_batches b
    WHERE b.channel IN ({{channels}})
"""
_RUNS = f"""
    SELECT {RUN_COLUMNS}, b.size_bytes, s.object, b.chunk_start, b.chunk_bytes, b.place
    FROM segment_runs b JOIN segments s ON s.segment = b.segment WHERE b.channel = ?
"""
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


@dataclass(frozen=True, slots=True)
class _Known:
    """A channel, and how long its longest run in a segment lasts."""

    channel: Channel
    longest_ns: int


def find_runs(
    engine: StoreEngine, robot_id: str, wanted: SampleFilter, *, limit: int, newest_first: bool = False
) -> list[StoredRun]:
    """The robot's runs that hold anything of what is wanted, at most `limit`, in order of their keys.

    They come by their lowest stamp; with `newest_first` by their highest one, descending.
    """
    with engine.transaction(write=False):
        known = _channels(engine, robot_id, wanted)
        most = min(limit, 2 * limit // max(1, len(known)) + 16)
        while True:
            parts = _parts(engine, known, wanted, most, newest_first=newest_first)
            runs = sorted(chain(*parts), key=lambda run: _sort_key(run, newest_first))
            # A part that was cut says nothing of what follows its end.
            ends = [_sort_key(part[-1], newest_first) for part in parts if len(part) == most]
            sure = sum(_sort_key(run, newest_first) <= min(ends) for run in runs) if ends else limit
            if sure >= limit or most == limit:
                return runs[:limit]
            most = min(limit, 8 * most)


def newest_candidates(engine: StoreEngine, robot_id: str, topic: str, t_ns: int) -> list[StoredRun]:
    """Runs one of which holds the topic's newest sample at or before `t_ns`; none of them when there is no such one.

    The newest run that ended by then comes first, if there is any, then those that go on after it, newest begin first.
    """
    ended, across = "b.last_ns <= ? ORDER BY b.last_ns DESC LIMIT 1", "b.last_ns > ? AND b.first_ns <= ?"
    before: list[Row] = []
    after: list[Row] = []
    with engine.transaction(write=False):
        known = _channels(engine, robot_id, SampleFilter(topic=topic))
        for number, channel in known.items():
            batches = _BATCHES.format(channels="?")
            before += engine.fetch(f"{batches} AND {ended}", number, t_ns)
            before += engine.fetch(f"{_RUNS} AND {ended}", number, t_ns)
            after += engine.fetch(f"{batches} AND {across}", number, t_ns, t_ns)
            near = f"{_RUNS} AND {across} AND b.last_ns <= ?"
            after += engine.fetch(near, number, t_ns, t_ns, _sum(t_ns, channel.longest_ns))
    runs = sorted((stored_run(known[row[0]].channel, row) for row in after), key=lambda run: -run.first_ns)
    done = (stored_run(known[row[0]].channel, row) for row in before)
    last = max(done, key=lambda run: run.last_ns, default=None)
    return [last, *runs] if last is not None else runs


def stored_topics(engine: StoreEngine, robot_id: str) -> list[StoredTopic]:
    """Every topic of which messages are stored, by name."""
    sums = (
        "channel, sum(count) AS samples, sum({size}) AS size_bytes, min(first_ns) AS first_ns, max(last_ns) AS last_ns"
    )
    own = "channel IN (SELECT channel FROM channels WHERE robot = ?)"
    query = (
        "SELECT c.topic, c.schema_name, c.class, CAST(sum(h.samples) AS BIGINT), CAST(sum(h.size_bytes) AS BIGINT),"
        " min(h.first_ns), max(h.last_ns) FROM ("
        f"SELECT {sums.format(size='length(payload)')} FROM sample_batches WHERE {own} GROUP BY channel"
        f" UNION ALL SELECT {sums.format(size='size_bytes')} FROM segment_runs WHERE {own} GROUP BY channel"
        ") AS h JOIN channels c ON c.channel = h.channel"
        " GROUP BY c.topic, c.schema_name, c.class ORDER BY c.topic, c.schema_name, c.class"
    )
    with engine.transaction(write=False):
        robot = _robot(engine, robot_id)
        rows = engine.fetch(query, robot, robot) if robot is not None else []
    return [StoredTopic(*row) for row in rows]


def stored_channels(engine: StoreEngine, robot_id: str, *, most: int) -> list[Channel]:
    """Of each topic of which messages are stored the channel with the newest of them, by topic; of `most` at most."""
    newest = "(SELECT max(b.last_ns) FROM {table} b WHERE b.channel = c.channel)"
    query = (
        f"SELECT {CHANNEL_COLUMNS}, {newest.format(table='sample_batches')}, {newest.format(table='segment_runs')}"
        " FROM channels c JOIN robots r ON r.robot = c.robot WHERE r.id = ? ORDER BY c.topic, c.channel LIMIT ?"
    )
    with engine.transaction(write=False):
        rows = engine.fetch(query, robot_id, most)
    found: dict[str, tuple[int, Row]] = {}
    for row in rows:
        ends_ns = [end_ns for end_ns in row[-2:] if end_ns is not None]
        if ends_ns and (row[1] not in found or found[row[1]][0] <= max(ends_ns)):
            found[row[1]] = (max(ends_ns), row)
    return [stored_channel(robot_id, row) for _, row in found.values()]


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


def _channels(engine: StoreEngine, robot_id: str, wanted: SampleFilter) -> dict[int, _Known]:
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
    return {row[0]: _Known(stored_channel(robot_id, row), row[9]) for row in rows}


def _order(newest_first: bool) -> str:
    columns = ("last_ns" if newest_first else "first_ns", "stream_id", "epoch", "first_seq")
    return ", ".join(f"b.{column}{' DESC' if newest_first else ''}" for column in columns)


def _sort_key(run: StoredRun, newest_first: bool) -> tuple[int, int, int, int]:
    """As the database orders them, where an epoch is a signed number; the first has the lowest."""
    sign = -1 if newest_first else 1
    stamp_ns, stream_id, epoch, first_seq = run.key(newest_first=newest_first)
    return (sign * stamp_ns, sign * stream_id, sign * signed(epoch), sign * first_seq)


def _parts(
    engine: StoreEngine, known: dict[int, _Known], wanted: SampleFilter, most: int, *, newest_first: bool
) -> list[list[StoredRun]]:
    """What is wanted of batches and of each channel's segments, each part in order and at most so many runs long."""
    where, values = _conditions(wanted, newest_first=newest_first)
    tail = f" ORDER BY {_order(newest_first)} LIMIT ?"
    parts = []
    for some in slices(list(known)):
        batches = " AND ".join([_BATCHES.format(channels=placeholders(len(some))), *where])
        parts.append(engine.fetch(batches + tail, *some, *values, most))
    for number, channel in known.items():
        for near, bounds in _pieces(wanted, channel.longest_ns, newest_first=newest_first):
            parts.append(engine.fetch(" AND ".join([_RUNS, *near, *where]) + tail, number, *bounds, *values, most))
    return [[stored_run(known[row[0]].channel, row) for row in part] for part in parts]


def _pieces(
    wanted: SampleFilter, longest_ns: int, *, newest_first: bool
) -> list[tuple[tuple[str, ...], tuple[int, ...]]]:
    """Conditions for one channel's runs in segments, such that the answer lies together in an index.

    The runs across the edge at which the order begins lie near it, as none lasts longer than `longest_ns`; the others
    come in the order that is asked for.
    """
    start_ns, end_ns = wanted.start_ns, wanted.end_ns
    if newest_first:
        if end_ns is None:
            return [((), ())]
        across = (("b.last_ns > ?", "b.last_ns <= ?"), (end_ns, _sum(end_ns, longest_ns)))
        return [across, (("b.last_ns <= ?",), (end_ns,))]
    if start_ns is None:
        return [((), ())]
    across = (("b.first_ns < ?", "b.last_ns <= ?"), (start_ns, _sum(start_ns, longest_ns)))
    return [across, (("b.first_ns >= ?",), (start_ns,))]


def _sum(stamp_ns: int, span_ns: int) -> int:
    return min(stamp_ns + span_ns, (1 << 63) - 1)


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
