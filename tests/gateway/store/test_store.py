"""Rows, watermarks and gaps: once each, through commits, merges, failures and restarts."""

from __future__ import annotations

import asyncio
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.domain.channel import Series
from gateway.domain.robot import Robot
from gateway.domain.sample import Gap, Rows
from gateway.errors import StoreError
from gateway.store import RobotWrite, Store, StreamWrite
from gateway.store.commit import Committer
from gateway.store.merge import merge_step, waiting_batches
from gateway.store.query import read_range, read_series, read_streams
from gateway.store.retention import Retention, purge_step, used_bytes
from gateway.store.schema import connect, migrate
from gateway.store.writer import Pace
from metaros.clock import ManualClock, SystemClock
from metaros.errors import ConfigError

RETENTION = Retention(age_s=100.0, size_bytes=1 << 30)
CPU, BATTERY = Series("host.cpu", "/host/cpu", "percent"), Series("battery", "/battery", "percentage")


def rows(*items: tuple[Series, int, float]) -> Rows:
    """Metric rows (series, stamp, value)."""
    series = tuple(dict.fromkeys(item[0] for item in items))
    return Rows(
        series,
        np.array([series.index(item[0]) for item in items], np.uint32),
        np.array([item[1] for item in items], np.int64),
        np.array([item[2] for item in items], np.float64),
    )


def write(seq: int, *items: tuple[Series, int, float], robot: str = "r1", **more: Any) -> StreamWrite:
    """A commit's write of the metric stream."""
    return StreamWrite(robot=robot, stream_id=0, epoch=2**64 - 3, seq=seq, rows=rows(*items) if items else None, **more)


@pytest.fixture
def database(tmp_path: Path) -> sqlite3.Connection:
    connection = connect(tmp_path)
    migrate(connection)
    yield connection
    connection.close()


def everything(connection: sqlite3.Connection, name: str, points: int = 10_000) -> list[tuple[float, float]]:
    """All rows of a series of r1."""
    (piece,) = read_range(connection, "r1", [name], start_ns=-(2**60), end_ns=2**60, points=points)
    return list(zip(np.rint(piece.stamp_ms * 1e6).tolist(), piece.mean.tolist(), strict=True))


def test_commit_moves_rows_watermark_and_gap_together(database: sqlite3.Connection) -> None:
    committer = Committer(database)
    gap = Gap(3, 9, "outbox_full", 1, 2)
    committer.commit([write(2, (CPU, 1, 0.5), (BATTERY, 2, 0.7)), write(9, gap=gap)], now_ns=5)
    assert read_streams(database, "r1") == {(0, 2**64 - 3): 9}
    assert database.execute("SELECT from_seq, to_seq, reason FROM gaps").fetchall() == [(3, 9, "outbox_full")]
    assert everything(database, "host.cpu") == [(1.0, 0.5)]
    facts = {item.series.name: (item.samples, item.stamp_ns, item.value) for item in read_series(database, "r1")}
    assert facts == {"battery": (1, 2, 0.7), "host.cpu": (1, 1, 0.5)}


def test_a_failed_commit_leaves_nothing_and_can_be_repeated(database: sqlite3.Connection) -> None:
    committer = Committer(database)
    pages = database.execute("PRAGMA page_count").fetchone()[0]
    database.execute(f"PRAGMA max_page_count = {pages + 2}")
    many = [write(n, *[(CPU, n * 1000 + i, 1.0) for i in range(1000)]) for n in range(1, 20)]
    with pytest.raises(sqlite3.OperationalError, match="full"):
        committer.commit(many, now_ns=1)
    assert read_streams(database, "r1") == {}
    database.execute("PRAGMA max_page_count = 1000000")
    committer.commit(many, now_ns=1)
    assert read_streams(database, "r1") == {(0, 2**64 - 3): 19}
    assert read_series(database, "r1")[0].samples == 19_000


@given(
    st.lists(st.lists(st.tuples(st.booleans(), st.integers(0, 5000)), min_size=1, max_size=400), max_size=12), st.data()
)
@settings(max_examples=25, deadline=None)
def test_merge_keeps_every_row_once(batches: list[list[tuple[bool, int]]], data: st.DataObject) -> None:
    connection = sqlite3.connect(":memory:", isolation_level=None)
    migrate(connection)
    committer = Committer(connection)
    expected: dict[str, list[int]] = {"host.cpu": [], "battery": []}
    seq = 0
    for batch in batches:
        items = [(CPU if cpu else BATTERY, stamp, float(stamp)) for cpu, stamp in batch]
        seq += len(items)
        committer.commit([write(seq, *items)], now_ns=seq)
        for series, stamp, _ in items:
            expected[series.name].append(stamp)
        if data.draw(st.booleans()):
            merge_step(connection, max_batches=data.draw(st.integers(1, 4)))
        for name, stamps in expected.items():
            assert [stamp for stamp, _ in everything(connection, name)] == sorted(stamps)
    while merge_step(connection, max_batches=2):
        pass
    assert waiting_batches(connection) == (0, 0)
    for name, stamps in expected.items():
        assert everything(connection, name) == [(float(s), float(s)) for s in sorted(stamps)]
    counts = [row[0] for row in connection.execute("SELECT count FROM metric_chunks")]
    assert sum(counts) == seq
    assert max(counts, default=0) <= 1000
    open_chunks = connection.execute("SELECT count(*) FROM metric_chunks WHERE count < 1000 GROUP BY series").fetchall()
    assert all(row[0] == 1 for row in open_chunks)
    connection.close()


def test_buckets_agree_with_numpy(database: sqlite3.Connection) -> None:
    rng = np.random.default_rng(1)
    stamps, values = np.arange(5000), rng.normal(size=5000)
    values[17] = np.nan
    committer = Committer(database)
    for start in range(0, 5000, 500):
        items = [
            (CPU, int(s), float(v))
            for s, v in zip(stamps[start : start + 500], values[start : start + 500], strict=True)
        ]
        committer.commit([write(start + 500, *items)], now_ns=1)
    merge_step(database, max_batches=7)
    (piece,) = read_range(database, "r1", ["host.cpu"], start_ns=0, end_ns=4999, points=50)
    assert piece.count.tolist() == [99] + [100] * 49
    np.testing.assert_allclose(piece.mean, [np.nanmean(values[i : i + 100]) for i in range(0, 5000, 100)])
    np.testing.assert_allclose(piece.max, [np.nanmax(values[i : i + 100]) for i in range(0, 5000, 100)])
    np.testing.assert_allclose(piece.min, [np.nanmin(values[i : i + 100]) for i in range(0, 5000, 100)])
    (none,) = read_range(database, "r1", ["nothing"], start_ns=0, end_ns=4999, points=50)
    assert len(none.count) == 0


def test_retention_by_age_and_by_size(database: sqlite3.Connection) -> None:
    committer = Committer(database)
    for day in range(4):
        committer.commit([write(day + 1, *[(CPU, i, 1.0) for i in range(1000)])], now_ns=day * 60 * 10**9)
        merge_step(database, max_batches=10)
    assert purge_step(database, RETENTION, now_ns=181 * 10**9) == 2
    assert purge_step(database, RETENTION, now_ns=181 * 10**9) == 0
    small = Retention(age_s=1e6, size_bytes=1)
    assert purge_step(database, small, now_ns=0) == 2
    assert used_bytes(database) > 0


def test_a_newer_schema_is_refused(database: sqlite3.Connection) -> None:
    database.execute("PRAGMA user_version = 99")
    with pytest.raises(StoreError):
        migrate(database)


def open_store(folder: Path, **options: Any) -> Store:
    chosen = {"clock": SystemClock(), "retention": RETENTION, "queue_bytes": 1 << 20, **options}
    return Store(folder, **chosen)


async def test_store_commits_and_remembers(tmp_path: Path) -> None:
    store = open_store(tmp_path)
    heard: list[Any] = []
    store.start(heard.extend)
    robot = Robot("r1", "/r1", "host", "1", {"site": "a"})
    store.submit(RobotWrite(robot, 7))
    store.submit(write(1, (CPU, 1, 1.0)))
    await store.flush()
    await asyncio.sleep(0)
    assert [type(item) for item in heard] == [RobotWrite, StreamWrite]
    ids = (store.store_id, store.gateway_id)
    await store.close()
    again = open_store(tmp_path)
    again.start()
    assert (again.store_id, again.gateway_id) == ids
    assert [item.robot for item in await again.robots()] == [robot]
    assert await again.streams("r1") == {(0, 2**64 - 3): 1}
    assert (await again.range("r1", ["host.cpu"], start_ns=0, end_ns=10, points=5))[0].mean.tolist() == [1.0]
    await again.close()


async def test_a_full_disk_keeps_the_writes_and_bounds_the_queue(tmp_path: Path) -> None:
    store = open_store(tmp_path, queue_bytes=4000, pace=Pace(retry_every_s=0.01))
    blocker = connect(tmp_path)
    blocker.execute("BEGIN IMMEDIATE")  # nobody else can commit: the writer's own timeout makes it fail and retry
    store.start()
    store._writer._connection.execute("PRAGMA busy_timeout = 1")
    for seq in range(1, 30):
        store.submit(write(seq, (CPU, seq, 1.0)))
    assert not await store.room(timeout_s=0.2)
    assert store.error is not None
    blocker.execute("ROLLBACK")
    blocker.close()
    assert await store.room(timeout_s=5)
    await store.flush()
    assert store.error is None
    assert (await store.series("r1"))[0].samples == 29
    await store.close()


def test_one_gateway_a_directory(tmp_path: Path) -> None:
    clock = ManualClock()
    first = open_store(tmp_path, clock=clock)
    with pytest.raises(ConfigError, match="another gateway"):
        open_store(tmp_path, clock=clock)
    asyncio.run(first.close())
    asyncio.run(open_store(tmp_path, clock=clock).close())
