"""One group commit: rows, watermarks and gaps of every link that waited, in one transaction.

The contract is kept here, whoever queued what: of every write only that is stored which follows its stream's
watermark, and the watermark moves with it. A commit may therefore be repeated, be it that its outcome is unknown or
that two gateways have the same samples.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt
import orjson

from gateway.domain.channel import EVENT, Channel, Series
from gateway.domain.robot import Robot
from gateway.domain.sample import Rows, Run
from gateway.store.engine import StoreEngine, placeholders, signed, slices
from gateway.store.writes import Committed, Mark, RobotWrite, StreamWrite, Write, WriterWrite

__all__ = ["CommitHook", "Committer"]

_Key = tuple[int, int, int]  # robot, stream, epoch
_REMEMBERED_MARKS = 1 << 18
_REMEMBERED_SETS = 1 << 12  # of series; each is kept alive by it

_PUT_ROBOT = """
    INSERT INTO robots (id, namespace, hostname, agent_version, labels, first_seen_ns, last_seen_ns)
    VALUES (?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (id) DO UPDATE SET namespace = excluded.namespace, hostname = excluded.hostname,
        agent_version = excluded.agent_version, labels = excluded.labels, last_seen_ns = excluded.last_seen_ns
"""
_NEW_ROBOT = """
    INSERT INTO robots (id, namespace, hostname, agent_version, labels, first_seen_ns, last_seen_ns)
    VALUES (?, '/', '', '', '{}', ?, ?) ON CONFLICT (id) DO NOTHING
"""
_PUT_CHANNEL = """
    INSERT INTO channels (robot, topic, schema_name, type_hash, encoding, class, schema_encoding, schema, qos)
    VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (robot, topic, schema_name, type_hash, encoding, class) DO UPDATE SET
        schema_encoding = excluded.schema_encoding, schema = excluded.schema, qos = excluded.qos
"""
_FIND_CHANNEL = """
    SELECT channel FROM channels
    WHERE robot = ? AND topic = ? AND schema_name = ? AND type_hash = ? AND encoding = ? AND class = ?
"""
_PUT_SERIES = """
    INSERT INTO series (robot, name, topic, field) VALUES (?, ?, ?, ?)
    ON CONFLICT (robot, name) DO UPDATE SET topic = excluded.topic, field = excluded.field
"""
_PUT_BATCH = """
    INSERT INTO sample_batches (robot, stream_id, epoch, first_seq, count, channel, event, first_ns, last_ns,
        receive_ns, stored_ns, stamps, lengths, payload) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)
"""
_PUT_ROWS = "INSERT INTO metric_batches (robot, count, stored_ns, series, stamps, vals) VALUES (?, ?, ?, ?, ?, ?)"
_PUT_GAP = "INSERT INTO gaps VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)"
_PUT_MARK = """
    INSERT INTO streams VALUES (?, ?, ?, ?, ?)
    ON CONFLICT (robot, stream_id, epoch) DO UPDATE SET seq = excluded.seq, updated_ns = excluded.updated_ns
"""
_PUT_WRITER = """
    INSERT INTO writers VALUES (?, ?, ?) ON CONFLICT (robot, epoch) DO UPDATE SET writer = excluded.writer
"""
_PUT_META = "INSERT INTO meta VALUES (?, ?) ON CONFLICT (key) DO UPDATE SET value = excluded.value"


class CommitHook(Protocol):
    """Somebody who stores what follows from samples in the very transaction that stores them; on the writer's thread.

    What it raises fails the commit: it raises nothing but StoreError.
    """

    def on_writes(self, engine: StoreEngine, fresh: Sequence[StreamWrite], now_ns: int) -> None:
        """These are stored if the transaction is."""

    def on_aborted(self) -> None:
        """The transaction was not: nothing of it happened, and it may come again."""


@dataclass(slots=True)
class _Group:
    """The rows of one commit, by table, and what they are of."""

    fresh: list[StreamWrite] = field(default_factory=list)
    batches: list[tuple[Any, ...]] = field(default_factory=list)
    rows: list[tuple[Any, ...]] = field(default_factory=list)
    gaps: list[tuple[Any, ...]] = field(default_factory=list)
    marks: dict[_Key, int] = field(default_factory=dict)


class Committer:
    """Turns writes into rows; keeps the numbers of robots, series and channels it has seen, and the watermarks."""

    def __init__(self, engine: StoreEngine, *, name: str = "") -> None:
        self.commit_hook: CommitHook | None = None
        self._engine = engine
        self._name = f"last_commit_ns {name}"
        self._robots: dict[str, int] = {}
        self._series: dict[tuple[int, str], int] = {}
        self._sets: dict[tuple[int, int], tuple[tuple[Series, ...], npt.NDArray[np.uint32]]] = {}
        self._channels: dict[tuple[Any, ...], int] = {}
        self._marks: dict[_Key, int] = {}

    def commit(self, writes: Sequence[Write], *, now_ns: int) -> Committed:
        """Store what is new of `writes`, all or nothing; StoreError when it did not work."""
        try:
            with self._engine.transaction(write=True):
                # Always something to write: a commit of nothing must not look like a disk that works.
                self._engine.execute(_PUT_META, self._name, str(now_ns))
                self._put_robots(writes, now_ns)
                self._put_writers(write for write in writes if isinstance(write, WriterWrite))
                marks = self._put_streams([write for write in writes if isinstance(write, StreamWrite)], now_ns)
        except BaseException:
            # Numbers given inside the rolled back transaction do not exist.
            for cache in (self._robots, self._series, self._sets, self._channels, self._marks):
                cache.clear()
            if self.commit_hook is not None:
                self.commit_hook.on_aborted()
            raise
        if self._engine.shared or len(self._marks) > _REMEMBERED_MARKS:
            self._marks.clear()
        return Committed(writes, marks)

    def _put_robots(self, writes: Sequence[Write], now_ns: int) -> None:
        """Robots first, in order of their names: whoever shares the database waits for each other here, if at all."""
        said = {write.robot.id: write for write in writes if isinstance(write, RobotWrite)}
        named = sorted({write.robot for write in writes if not isinstance(write, RobotWrite)} | said.keys())
        new = [robot_id for robot_id in named if robot_id not in self._robots]
        self._engine.many(_NEW_ROBOT, [(robot_id, now_ns, now_ns) for robot_id in new])
        for some in slices(named if self._engine.shared else new):
            find = f"SELECT id, robot FROM robots WHERE id IN ({placeholders(len(some))}) ORDER BY id"
            self._robots.update(
                (row[0], int(row[1])) for row in self._engine.fetch(find + self._engine.for_update, *some)
            )
        self._engine.many(_PUT_ROBOT, [_robot_row(said[key].robot, said[key].seen_ns) for key in sorted(said)])

    def _put_writers(self, writes: Iterable[WriterWrite]) -> None:
        last = {(self._robots[write.robot], signed(write.epoch)): _text(write.writer) for write in writes}
        self._engine.many(_PUT_WRITER, [(*key, writer) for key, writer in last.items()])

    def _put_streams(self, writes: Sequence[StreamWrite], now_ns: int) -> list[Mark]:
        touched = {
            (self._robots[write.robot], write.stream_id, signed(write.epoch)): (write.robot, write.epoch)
            for write in writes
        }
        self._read_marks([key for key in touched if key not in self._marks])
        group = _Group()
        for write in writes:
            key = (self._robots[write.robot], write.stream_id, signed(write.epoch))
            fresh = write.after(self._marks.get(key, write.base))
            if fresh is not None:
                self._add(group, key, fresh, now_ns)
                group.fresh.append(fresh)
                self._marks[key] = group.marks[key] = write.seq
        self._engine.many(_PUT_BATCH, group.batches)
        self._engine.many(_PUT_ROWS, group.rows)
        self._engine.many(_PUT_GAP, group.gaps)
        self._engine.many(_PUT_MARK, [(*key, seq, now_ns) for key, seq in group.marks.items()])
        if self.commit_hook is not None and group.fresh:
            self.commit_hook.on_writes(self._engine, group.fresh, now_ns)
        return [
            Mark(robot, key[1], epoch, self._marks[key])
            for key, (robot, epoch) in touched.items()
            if key in self._marks
        ]

    def _read_marks(self, keys: Sequence[_Key]) -> None:
        """The watermarks as they are stored; a stream without one is new."""
        for some in slices(keys):
            values = ", ".join(["(CAST(? AS BIGINT), CAST(? AS BIGINT), CAST(? AS BIGINT))"] * len(some))
            find = (
                f"SELECT s.robot, s.stream_id, s.epoch, s.seq FROM (VALUES {values}) AS k JOIN streams s"
                " ON s.robot = k.column1 AND s.stream_id = k.column2 AND s.epoch = k.column3"
            )
            for robot, stream_id, epoch, seq in self._engine.fetch(find, *(number for key in some for number in key)):
                self._marks[robot, stream_id, epoch] = int(seq)

    def _add(self, group: _Group, key: _Key, write: StreamWrite, now_ns: int) -> None:
        if write.run is not None:
            group.batches.append(self._batch_row(key, write.run, now_ns))
        if write.rows is not None:
            group.rows.append(self._metric_row(key[0], write.rows, now_ns))
        if write.gap is not None:
            gap = write.gap
            group.gaps.append((*key, gap.from_seq, gap.to_seq, _text(gap.reason), gap.from_ns, gap.to_ns, now_ns))

    def _batch_row(self, key: _Key, run: Run, now_ns: int) -> tuple[Any, ...]:
        columns = run.columns
        stamps = columns.stamps_ns
        return (
            *key,
            columns.first_seq,
            columns.count,
            self._channel_number(key[0], run.channel),
            int(run.channel.delivery == EVENT),
            int(stamps.min()),
            int(stamps.max()),
            run.receive_ns,
            now_ns,
            stamps.tobytes(),
            np.diff(columns.offsets).astype("<u4").tobytes(),
            columns.payload,
        )

    def _metric_row(self, robot: int, rows: Rows, now_ns: int) -> tuple[Any, ...]:
        numbers = self._series_numbers(robot, rows.series)[rows.index]
        return robot, len(rows), now_ns, numbers.data, rows.stamps.data, rows.values.data

    def _series_numbers(self, robot: int, series: tuple[Series, ...]) -> npt.NDArray[np.uint32]:
        """The numbers of series that came together; found at once where the very same came before."""
        known = self._sets.get((robot, id(series)))
        if known is not None and known[0] is series:
            return known[1]
        numbers = np.array([self._series_number(robot, s.name, s.topic, s.field) for s in series], np.uint32)
        if len(self._sets) >= _REMEMBERED_SETS:
            self._sets.clear()
        self._sets[robot, id(series)] = series, numbers
        return numbers

    def _channel_number(self, robot: int, channel: Channel) -> int:
        texts = (channel.topic, channel.schema_name, channel.type_hash, channel.encoding, channel.delivery)
        key = (robot, *map(_text, texts))
        number = self._channels.get(key)
        if number is None:
            self._engine.execute(_PUT_CHANNEL, *key, _text(channel.schema_encoding), channel.schema, _text(channel.qos))
            number = self._channels[key] = int(self._engine.fetch(_FIND_CHANNEL, *key)[0][0])
        return number

    def _series_number(self, robot: int, name: str, topic: str, field_name: str) -> int:
        key = (robot, _text(name))
        number = self._series.get(key)
        if number is None:
            self._engine.execute(_PUT_SERIES, *key, _text(topic), _text(field_name))
            find = "SELECT series FROM series WHERE robot = ? AND name = ?"
            number = self._series[key] = int(self._engine.fetch(find, *key)[0][0])
        return number


def _robot_row(robot: Robot, seen_ns: int) -> tuple[Any, ...]:
    labels = orjson.dumps(dict(robot.labels)).decode()
    texts = (robot.id, robot.namespace, robot.hostname, robot.agent_version, labels)
    return (*map(_text, texts), seen_ns, seen_ns)


def _text(text: str) -> str:
    """A robot's text as every database takes it: PostgreSQL knows no NUL."""
    return text.replace("\0", "\ufffd") if "\0" in text else text
