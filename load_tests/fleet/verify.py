"""Is every sample that robots handed over in the store once? The database is read after the gateway has ended."""

from __future__ import annotations

import sqlite3
from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np

from gateway.store.integrity.streams import Interval, audit
from gateway.store.telemetry.chunks import decode
from load_tests.fleet.robot import Robot

__all__ = ["Verdict", "verify"]

INTERVALS = """
    SELECT robot, stream_id, epoch, first_seq, first_seq + count - 1, first_ns, last_ns, channel FROM sample_batches
    UNION ALL
    SELECT robot, stream_id, epoch, first_seq, first_seq + count - 1, first_ns, last_ns, channel FROM segment_runs
    UNION ALL SELECT robot, stream_id, epoch, from_seq, to_seq, from_ns, to_ns, NULL FROM gaps
    ORDER BY 1, 2, 3, 4
"""


@dataclass(slots=True)
class Verdict:
    """Of all robots together; `accepted` are samples and rows."""

    accepted: int = 0
    stored: int = 0
    declared: int = 0  # lost with a gap in their place
    lost: int = 0
    duplicated: int = 0
    waiting: int = 0  # handed over, and never acknowledged: the run ended before
    problems: list[str] = field(default_factory=list)

    @property
    def good(self) -> bool:
        """Whether the promise was kept."""
        return not (self.lost or self.duplicated)

    def blame(self, kind: str, count: int, text: str) -> None:
        """Something is not as promised."""
        setattr(self, kind, getattr(self, kind) + count)
        self.problems.append(f"{kind} {count}: {text}")


def verify(database: Path, robots: Iterable[Robot]) -> Verdict:
    """Compare what robots handed over with what the store has: numbers of samples, and the values of rows."""
    verdict, by_name = Verdict(), {robot.name: robot for robot in robots}
    connection = sqlite3.connect(f"file:{database}?mode=ro", uri=True)
    connection.row_factory = sqlite3.Row
    try:
        numbers = {row["robot"]: row["id"] for row in connection.execute("SELECT robot, id FROM robots")}
        marks = _marks(connection)
        stored = _samples(connection, marks, numbers, verdict)
        values = _rows(connection)
    finally:
        connection.close()
    lost_rows = _declared_rows(marks, stored.gaps)
    for number, name in numbers.items():
        if (robot := by_name.pop(name, None)) is not None:
            _compare(robot, number, marks, stored.counts, values, lost_rows, verdict)
    for robot in by_name.values():  # the store does not even know their names
        if robot.rows or robot.samples:
            verdict.accepted += robot.rows + robot.samples
            verdict.blame("lost", robot.rows + robot.samples, f"robot {robot.name} is not in the store")
    return verdict


@dataclass(slots=True)
class _Samples:
    counts: dict[int, int] = field(default_factory=lambda: defaultdict(int))  # robot -> samples and declared ones
    gaps: dict[tuple[int, int], int] = field(default_factory=lambda: defaultdict(int))  # (robot, stream) -> declared


def _marks(connection: Any) -> dict[tuple[int, int, int], int]:
    rows = connection.execute("SELECT robot, stream_id, epoch, seq FROM streams")
    return {(row["robot"], row["stream_id"], row["epoch"]): row["seq"] for row in rows}


def _samples(connection: Any, marks: Any, numbers: dict[int, str], verdict: Verdict) -> _Samples:
    """Count what each robot has, and find what is missing within a stream or there twice."""
    found = _Samples()
    rows = connection.execute(INTERVALS)
    for (robot, stream, epoch), some in groupby(rows, key=lambda row: (row[0], row[1], row[2])):
        intervals = [Interval(*tuple(row)[3:]) for row in some]
        for interval in intervals:
            count = interval.last_seq - interval.first_seq + 1
            if interval.channel is None:
                found.gaps[robot, stream] += count
                verdict.declared += count
            else:
                verdict.stored += count
            if stream & 0x7FFFFFFF:
                found.counts[robot] += count
        for fault in audit(intervals, marks.get((robot, stream, epoch), 0)):
            kind = "duplicated" if fault.what == "twice" else "lost"
            verdict.blame(kind, fault.last_seq - fault.first_seq + 1, f"{numbers[robot]} stream {stream}: {fault}")
    return found


def _rows(connection: Any) -> dict[int, list[Any]]:
    """Robot -> arrays of the whole parts of its rows' values, which count up from 1."""
    values: dict[int, list[Any]] = defaultdict(list)
    for row in connection.execute("SELECT robot, vals FROM metric_batches"):
        values[row["robot"]].append(np.frombuffer(row["vals"], "<f8").astype(np.int64))
    chunks = "SELECT s.robot AS of_robot, c.* FROM metric_chunks c JOIN series s ON s.series = c.series"
    for row in connection.execute(chunks):
        if "encoding" in row.keys():  # noqa: SIM118 - sqlite3.Row
            chunk = (int(row["encoding"]), int(row["count"]), bytes(row["stamps"]), bytes(row["vals"]))
            values[row["of_robot"]].append(np.asarray(decode([chunk])[1]).astype(np.int64))
        else:
            values[row["of_robot"]].append(np.frombuffer(row["vals"], "<f8").astype(np.int64))
    return values


def _declared_rows(marks: Any, gaps: dict[tuple[int, int], int]) -> dict[int, int]:
    """Robot -> rows that were declared lost."""
    return {robot: count for (robot, stream), count in gaps.items() if not stream & 0x7FFFFFFF}


def _compare(
    robot: Robot,
    number: int,
    marks: Any,
    samples: dict[int, int],
    values: dict[int, list[Any]],
    lost_rows: dict[int, int],
    verdict: Verdict,
) -> None:
    """One robot: every row's value once, as many samples as it handed over."""
    verdict.accepted += robot.rows + robot.samples
    waiting = sum(frame.count for log in robot.outbox.logs.values() for frame in log.held)
    verdict.waiting += waiting
    if not waiting and samples.get(number, 0) != robot.samples:
        missing = robot.samples - samples.get(number, 0)
        kind = "lost" if missing > 0 else "duplicated"
        verdict.blame(kind, abs(missing), f"{robot.name} handed over {robot.samples} samples")
    have = np.concatenate(values[number]) if values.get(number) else np.zeros(0, np.int64)
    verdict.stored += len(have)
    seen = np.bincount(have, minlength=robot.rows + 1)
    twice = int(np.maximum(seen - 1, 0).sum())
    missing = robot.rows - int(np.count_nonzero(seen)) - lost_rows.get(number, 0)
    if twice:
        verdict.blame("duplicated", twice, f"{robot.name}: rows are there twice")
    if missing > 0 and not waiting:
        verdict.blame("lost", missing, f"{robot.name}: of {robot.rows} rows")
