"""One group commit: rows, watermarks and gaps of every link that waited, in one transaction."""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence

import numpy as np
import orjson

from gateway.domain.channel import Channel
from gateway.domain.robot import Robot
from gateway.domain.sample import Gap, Rows, Run
from gateway.store.schema import signed
from gateway.store.writes import RobotWrite, StreamWrite, Write, WriterWrite

__all__ = ["Committer"]

_UPSERT_ROBOT = """
    INSERT INTO robots (id, namespace, hostname, agent_version, labels, first_seen_ns, last_seen_ns)
    VALUES (?, ?, ?, ?, ?, ?, ?)
    ON CONFLICT (id) DO UPDATE SET namespace = excluded.namespace, hostname = excluded.hostname,
        agent_version = excluded.agent_version, labels = excluded.labels, last_seen_ns = excluded.last_seen_ns
"""
_UPSERT_STREAM = """
    INSERT INTO streams VALUES (?, ?, ?, ?, ?)
    ON CONFLICT (robot, stream_id, epoch) DO UPDATE SET seq = max(seq, excluded.seq), updated_ns = excluded.updated_ns
"""


class Committer:
    """Turns writes into SQL; keeps the numbers of robots and series it has seen."""

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection
        self._robots: dict[str, int] = {}
        self._series: dict[tuple[int, str], int] = {}
        self._channels: dict[tuple[int, str, str, str, str, str], int] = {}

    def commit(self, writes: Sequence[Write], *, now_ns: int) -> None:
        """Store all of `writes` or none; raises sqlite3.Error after rolling back."""
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            # Always something to write: a commit of nothing must not look like a disk that works.
            self._connection.execute("INSERT OR REPLACE INTO meta VALUES ('last_commit_ns', ?)", (str(now_ns),))
            for write in writes:
                if isinstance(write, RobotWrite):
                    self._put_robot(write.robot, write.seen_ns)
                elif isinstance(write, WriterWrite):
                    self._put_writer(write, now_ns)
                else:
                    self._put_stream(write, now_ns)
            self._connection.execute("COMMIT")
        except BaseException:
            if self._connection.in_transaction:
                self._connection.execute("ROLLBACK")
            # Numbers given inside the rolled back transaction do not exist.
            self._robots.clear()
            self._series.clear()
            self._channels.clear()
            raise

    def _put_robot(self, robot: Robot, seen_ns: int) -> None:
        labels = orjson.dumps(dict(robot.labels)).decode()
        values = (robot.id, robot.namespace, robot.hostname, robot.agent_version, labels, seen_ns, seen_ns)
        self._connection.execute(_UPSERT_ROBOT, values)

    def _put_stream(self, write: StreamWrite, now_ns: int) -> None:
        robot = self._robot_number(write.robot, now_ns)
        key = (robot, write.stream_id, signed(write.epoch))
        if write.run is not None:
            self._put_run(key, write.run, now_ns)
        if write.rows is not None:
            self._put_rows(robot, write.rows, now_ns)
        if write.gap is not None:
            self._put_gap(key, write.gap, now_ns)
        self._connection.execute(_UPSERT_STREAM, (*key, write.seq, now_ns))

    def _put_writer(self, write: WriterWrite, now_ns: int) -> None:
        robot = self._robot_number(write.robot, now_ns)
        self._connection.execute(
            "INSERT OR REPLACE INTO writers VALUES (?, ?, ?)", (robot, signed(write.epoch), write.writer)
        )

    def _put_run(self, key: tuple[int, int, int], run: Run, now_ns: int) -> None:
        columns = run.columns
        stamps = columns.stamps_ns
        channel = self._channel_number(key[0], run.channel)
        lengths = np.diff(columns.offsets).astype("<u4").tobytes()
        self._connection.execute(
            "INSERT INTO sample_batches (robot, stream_id, epoch, first_seq, count, channel, first_ns, last_ns,"
            " receive_ns, stored_ns, stamps, lengths, payload) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (
                *key,
                columns.first_seq,
                columns.count,
                channel,
                int(stamps.min()),
                int(stamps.max()),
                run.receive_ns,
                now_ns,
                stamps.tobytes(),
                lengths,
                columns.payload,
            ),
        )

    def _channel_number(self, robot: int, channel: Channel) -> int:
        key = (robot, channel.topic, channel.schema_name, channel.type_hash, channel.encoding, channel.delivery)
        number = self._channels.get(key)
        if number is None:
            self._connection.execute(
                "INSERT INTO channels (robot, topic, schema_name, type_hash, encoding, class, schema_encoding, schema,"
                " qos) VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (robot, topic, schema_name, type_hash, encoding,"
                " class) DO UPDATE SET schema_encoding = excluded.schema_encoding, schema = excluded.schema,"
                " qos = excluded.qos",
                (*key, channel.schema_encoding, channel.schema, channel.qos),
            )
            find = (
                "SELECT channel FROM channels WHERE robot = ? AND topic = ? AND schema_name = ? AND type_hash = ?"
                " AND encoding = ? AND class = ?"
            )
            number = self._channels[key] = int(self._connection.execute(find, key).fetchone()[0])
        return number

    def _put_rows(self, robot: int, rows: Rows, now_ns: int) -> None:
        numbers = np.array([self._series_number(robot, s.name, s.topic, s.field) for s in rows.series], np.uint32)
        series = numbers[rows.index].tobytes()
        self._connection.execute(
            "INSERT INTO metric_batches (robot, count, stored_ns, series, stamps, vals) VALUES (?, ?, ?, ?, ?, ?)",
            (robot, len(rows), now_ns, series, rows.stamps.tobytes(), rows.values.tobytes()),
        )

    def _put_gap(self, key: tuple[int, int, int], gap: Gap, now_ns: int) -> None:
        self._connection.execute(
            "INSERT OR IGNORE INTO gaps VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
            (*key, gap.from_seq, gap.to_seq, gap.reason, gap.from_ns, gap.to_ns, now_ns),
        )

    def _robot_number(self, robot_id: str, now_ns: int) -> int:
        number = self._robots.get(robot_id)
        if number is None:
            self._connection.execute(
                "INSERT OR IGNORE INTO robots VALUES (NULL, ?, '/', '', '', '{}', ?, ?)", (robot_id, now_ns, now_ns)
            )
            row = self._connection.execute("SELECT robot FROM robots WHERE id = ?", (robot_id,)).fetchone()
            number = self._robots[robot_id] = int(row[0])
        return number

    def _series_number(self, robot: int, name: str, topic: str, field: str) -> int:
        number = self._series.get((robot, name))
        if number is None:
            self._connection.execute(
                "INSERT INTO series (robot, name, topic, field) VALUES (?, ?, ?, ?)"
                " ON CONFLICT (robot, name) DO UPDATE SET topic = excluded.topic, field = excluded.field",
                (robot, name, topic, field),
            )
            find = "SELECT series FROM series WHERE robot = ? AND name = ?"
            number = self._series[robot, name] = int(self._connection.execute(find, (robot, name)).fetchone()[0])
        return number
