"""Reading: robots, watermarks, gaps and what series there are; each on a snapshot of its own."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import orjson

from gateway.domain.channel import METRIC_STREAM, Series
from gateway.domain.robot import Robot
from gateway.domain.sample import Gap
from gateway.store.engine import Row, StoreEngine, unsigned
from gateway.store.telemetry.chunks import decode
from gateway.store.telemetry.series import waiting_rows
from metaros.link import BACKFILL_BIT

__all__ = [
    "SeriesFacts",
    "StoredGap",
    "StoredRobot",
    "read_gaps",
    "read_metric_marks",
    "read_robots",
    "read_series",
    "read_streams",
    "read_writers",
]

_SERIES = """
    SELECT series, name, topic, field,
        (SELECT CAST(sum(count) AS BIGINT) FROM metric_chunks c WHERE c.series = s.series)
    FROM series s JOIN robots USING (robot) WHERE id = ? ORDER BY name
"""
_NEWEST = """
    SELECT c.series, c.encoding, c.count, c.stamps, c.vals
    FROM series s JOIN robots r ON r.robot = s.robot
    JOIN metric_chunks c
        ON c.chunk = (SELECT chunk FROM metric_chunks n WHERE n.series = s.series ORDER BY last_ns DESC LIMIT 1)
    WHERE r.id = ?
"""


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


def read_metric_marks(engine: StoreEngine) -> dict[tuple[str, int, int], int]:
    """The watermarks of all robots' metric rows, by (robot, stream, epoch)."""
    query = "SELECT id, stream_id, epoch, seq FROM streams JOIN robots USING (robot) WHERE stream_id IN (?, ?)"
    rows = _snapshot(engine, query, METRIC_STREAM, METRIC_STREAM | BACKFILL_BIT)
    return {(row[0], row[1], unsigned(row[2])): row[3] for row in rows}


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
        rows = engine.fetch(_SERIES, robot_id)
        facts = {row[0]: SeriesFacts(Series(row[1], row[2], row[3]), row[4] or 0) for row in rows}
        for number, *chunk in engine.fetch(_NEWEST, robot_id):
            with contextlib.suppress(ValueError):  # damaged: the series is listed all the same
                stamps, values = decode([tuple(chunk)])
                facts[number].stamp_ns, facts[number].value = int(stamps[-1]), float(values[-1])
        series, stamps, values = waiting_rows(engine, robot_id)
    numbers, places, counts = np.unique(series[::-1], return_index=True, return_counts=True)
    for number, place, count in zip(numbers.tolist(), places.tolist(), counts.tolist(), strict=True):
        fact, last = facts[number], len(series) - 1 - place
        fact.samples += count
        fact.stamp_ns, fact.value = int(stamps[last]), float(values[last])
    return list(facts.values())


def _snapshot(engine: StoreEngine, query: str, *values: Any) -> Sequence[Row]:
    with engine.transaction(write=False):
        return engine.fetch(query, *values)
