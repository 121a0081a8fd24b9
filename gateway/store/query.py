"""Reading: robots, watermarks, series, and ranges of series in buckets; each on a snapshot of its own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import orjson

from gateway.domain.channel import Series
from gateway.domain.robot import Robot
from gateway.domain.sample import Gap
from gateway.store.engine import Row, StoreEngine, unsigned

__all__ = [
    "SeriesFacts",
    "SeriesRange",
    "StoredGap",
    "StoredRobot",
    "read_gaps",
    "read_range",
    "read_robots",
    "read_series",
    "read_streams",
    "read_writers",
]

Stamps = npt.NDArray[np.int64]
Values = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class StoredRobot:
    """A robot of an earlier day and when it was last seen."""

    robot: Robot
    first_seen_ns: int
    last_seen_ns: int


@dataclass(frozen=True, slots=True)
class StoredGap:
    """A declared loss, and when it was stored."""

    stream_id: int
    epoch: int
    gap: Gap
    stored_ns: int


@dataclass(slots=True)
class SeriesFacts:
    """One series, how much of it is stored, and its newest row."""

    series: Series
    samples: int = 0
    stamp_ns: int | None = None
    value: float | None = None


@dataclass(frozen=True, slots=True)
class SeriesRange:
    """A piece of one series: rows as they are (count 1) or buckets with mean, min, max and count."""

    name: str
    stamp_ms: npt.NDArray[np.float64]
    mean: Values
    min: Values
    max: Values
    count: npt.NDArray[np.int64]


def read_robots(engine: StoreEngine) -> list[StoredRobot]:
    """Every robot that ever connected."""
    query = "SELECT id, namespace, hostname, agent_version, labels, first_seen_ns, last_seen_ns FROM robots"
    return [
        StoredRobot(Robot(row[0], row[1], row[2], row[3], orjson.loads(row[4])), row[5], row[6])
        for row in _snapshot(engine, query)
    ]


def read_streams(engine: StoreEngine, robot_id: str) -> dict[tuple[int, int], int]:
    """The robot's watermarks by (stream, epoch)."""
    query = "SELECT stream_id, epoch, seq FROM streams JOIN robots USING (robot) WHERE id = ?"
    return {(row[0], unsigned(row[1])): row[2] for row in _snapshot(engine, query, robot_id)}


def read_writers(engine: StoreEngine, robot_id: str) -> dict[int, str]:
    """Who last wrote under each of the robot's epochs."""
    query = "SELECT epoch, writer FROM writers JOIN robots USING (robot) WHERE id = ?"
    return {unsigned(row[0]): row[1] for row in _snapshot(engine, query, robot_id)}


def read_gaps(engine: StoreEngine, robot_id: str, *, limit: int) -> list[StoredGap]:
    """The robot's declared losses, the newest first."""
    query = (
        "SELECT stream_id, epoch, from_seq, to_seq, reason, from_ns, to_ns, stored_ns FROM gaps"
        " JOIN robots USING (robot) WHERE id = ? ORDER BY stored_ns DESC, from_seq DESC LIMIT ?"
    )
    rows = _snapshot(engine, query, robot_id, limit)
    return [StoredGap(row[0], unsigned(row[1]), Gap(*row[2:7]), row[7]) for row in rows]


def read_series(engine: StoreEngine, robot_id: str) -> list[SeriesFacts]:
    """The robot's series by name, with stored counts and newest rows."""
    with engine.transaction(write=False):
        listing = (
            "SELECT series, name, topic, field,"
            " (SELECT CAST(sum(count) AS BIGINT) FROM metric_chunks c WHERE c.series = s.series)"
            " FROM series s JOIN robots USING (robot) WHERE id = ? ORDER BY name"
        )
        rows = engine.fetch(listing, robot_id)
        facts = {row[0]: SeriesFacts(Series(row[1], row[2], row[3]), row[4] or 0) for row in rows}
        for number, fact in facts.items():
            newest = "SELECT stamps, vals FROM metric_chunks WHERE series = ? ORDER BY last_ns DESC LIMIT 1"
            for row in engine.fetch(newest, number):
                fact.stamp_ns = int(np.frombuffer(row[0], np.int64)[-1])
                fact.value = float(np.frombuffer(row[1])[-1])
        for series, stamps, values in _waiting(engine, robot_id):
            numbers, counts = np.unique(series, return_counts=True)
            for number, count in zip(numbers.tolist(), counts.tolist(), strict=True):
                last = int(np.flatnonzero(series == number)[-1])
                fact = facts[number]
                fact.samples += count
                fact.stamp_ns, fact.value = int(stamps[last]), float(values[last])
    return list(facts.values())


def read_range(
    engine: StoreEngine, robot_id: str, names: Sequence[str], *, start_ns: int, end_ns: int, points: int
) -> list[SeriesRange]:
    """Each named series between two stamps, both included; a name nobody stored gives an empty range."""
    with engine.transaction(write=False):
        waiting = list(_waiting(engine, robot_id))
        ranges = []
        for name in names:
            buckets = _Buckets(start_ns=start_ns, end_ns=end_ns, points=points)
            find = "SELECT series FROM series JOIN robots USING (robot) WHERE id = ? AND name = ?"
            for row in engine.fetch(find, robot_id, name):
                for stamps, values in _rows(engine, row[0], waiting, start_ns=start_ns, end_ns=end_ns):
                    buckets.add(stamps, values)
            ranges.append(buckets.result(name))
        return ranges


def _snapshot(engine: StoreEngine, query: str, *values: Any) -> Sequence[Row]:
    with engine.transaction(write=False):
        return engine.fetch(query, *values)


def _waiting(engine: StoreEngine, robot_id: str) -> Iterator[tuple[npt.NDArray[np.uint32], Stamps, Values]]:
    """The robot's batches that the merge has not moved yet."""
    query = (
        "SELECT series, stamps, vals FROM metric_batches"
        " WHERE robot = (SELECT robot FROM robots WHERE id = ?) ORDER BY batch"
    )
    rows = engine.fetch(query, robot_id)
    if rows:
        yield (
            np.frombuffer(b"".join(row[0] for row in rows), np.uint32),
            np.frombuffer(b"".join(row[1] for row in rows), np.int64),
            np.frombuffer(b"".join(row[2] for row in rows), np.float64),
        )


def _rows(
    engine: StoreEngine,
    series: int,
    waiting: list[tuple[npt.NDArray[np.uint32], Stamps, Values]],
    *,
    start_ns: int,
    end_ns: int,
) -> Iterator[tuple[Stamps, Values]]:
    """Pieces of one series, chunks first, each cut to the range and without NaN."""
    query = (
        "SELECT stamps, vals FROM metric_chunks WHERE series = ? AND last_ns >= ? AND first_ns <= ? ORDER BY last_ns"
    )
    pieces = [
        (np.frombuffer(row[0], np.int64), np.frombuffer(row[1]))
        for row in engine.fetch(query, series, start_ns, end_ns)
    ]
    for numbers, stamps, values in waiting:
        mine = numbers == series
        pieces.append((stamps[mine], values[mine]))
    for stamps, values in pieces:
        keep = (stamps >= start_ns) & (stamps <= end_ns) & ~np.isnan(values)
        if keep.any():
            yield stamps[keep], values[keep]


class _Buckets:
    """Aggregates rows as they come, and keeps them raw as long as they are few."""

    def __init__(self, *, start_ns: int, end_ns: int, points: int) -> None:
        self._start_ns = start_ns
        self._width_ns = max(1, -(-(end_ns - start_ns + 1) // points))
        self._points = points
        self._raw: list[tuple[Stamps, Values]] | None = []
        self._raw_rows = 0
        self._count = np.zeros(points, np.int64)
        self._sum = np.zeros(points)
        self._min = np.full(points, np.inf)
        self._max = np.full(points, -np.inf)

    def add(self, stamps: Stamps, values: Values) -> None:
        """Count some rows of the range in."""
        self._raw_rows += len(stamps)
        if self._raw is not None:
            self._raw.append((stamps, values))
            if self._raw_rows <= self._points:
                return
            for held in self._raw:
                self._aggregate(*held)
            self._raw = None
            return
        self._aggregate(stamps, values)

    def result(self, name: str) -> SeriesRange:
        """Raw rows when no more than the asked points, else the buckets that hold any."""
        if self._raw is not None:
            return self._raw_result(name)
        full = np.flatnonzero(self._count)
        middle_ms = (self._start_ns + full * self._width_ns + self._width_ns // 2) / 1e6
        count = self._count[full]
        return SeriesRange(name, middle_ms, self._sum[full] / count, self._min[full], self._max[full], count)

    def _raw_result(self, name: str) -> SeriesRange:
        pieces = self._raw or [(np.empty(0, np.int64), np.empty(0))]
        stamps = np.concatenate([piece[0] for piece in pieces])
        values = np.concatenate([piece[1] for piece in pieces])
        order = np.argsort(stamps, kind="stable")
        stamps, values = stamps[order], values[order]
        return SeriesRange(name, stamps / 1e6, values, values, values, np.ones(len(values), np.int64))

    def _aggregate(self, stamps: Stamps, values: Values) -> None:
        bucket = (stamps - self._start_ns) // self._width_ns
        self._count += np.bincount(bucket, minlength=self._points)
        self._sum += np.bincount(bucket, weights=values, minlength=self._points)
        np.minimum.at(self._min, bucket, values)
        np.maximum.at(self._max, bucket, values)
