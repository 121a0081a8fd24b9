"""Ranges of series against brute force, on both databases: what buckets hold at their edges, lines, losses, damage."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.sqlite import SqliteEngine
from gateway.store.telemetry.chunks import PLAIN
from gateway.store.telemetry.merge import merge_step
from gateway.store.telemetry.query import read_series
from gateway.store.telemetry.series import SeriesRange, read_metric_gaps, read_range
from metaros.link import BACKFILL_BIT
from tests.gateway.store.samples import BATTERY, CPU, everything, gap_write, run_write, write
from tests.support.servers.sqlite_store import place_store

NAN, INF = float("nan"), float("inf")
Point = tuple[int, float]


def put(engine: StoreEngine, points: Sequence[Point], *, batch: int = 100, merged: int = 1 << 20) -> None:
    """Commit the points in batches, and merge some of the batches."""
    committer = Committer(engine)
    for first in range(0, len(points), batch):
        rows = [(CPU, stamp_ns, value) for stamp_ns, value in points[first : first + batch]]
        committer.commit([write(first + len(rows), *rows)], now_ns=1)
    merge_step(engine, max_batches=merged)


def ranged(engine: StoreEngine, start_ns: int, end_ns: int, points: int, **options: object) -> SeriesRange:
    """A range of the one series."""
    found = read_range(engine, "r1", ["host.cpu"], start_ns=start_ns, end_ns=end_ns, points=points, **options)  # type: ignore[arg-type]
    return found[0]


def check(engine: StoreEngine, points: Sequence[Point], start_ns: int, end_ns: int, buckets: int) -> None:
    """What is read is what a loop over all points finds."""
    found = ranged(engine, start_ns, end_ns, buckets)
    inside = sorted((p for p in points if start_ns <= p[0] <= end_ns and not np.isnan(p[1])), key=lambda p: p[0])
    if len(inside) <= buckets:
        assert sorted(zip(found.stamp_ms.tolist(), found.mean.tolist(), strict=True)) == sorted(
            (stamp_ns / 1e6, value) for stamp_ns, value in inside
        )
        assert found.count.tolist() == [1] * len(inside)
        return
    width_ns = max(1, -(-(end_ns - start_ns + 1) // buckets))
    groups: dict[int, list[float]] = {}
    for stamp_ns, value in inside:
        groups.setdefault((stamp_ns - start_ns) // width_ns, []).append(value)
    middles = [(start_ns + place * width_ns + width_ns // 2) / 1e6 for place in groups]
    assert found.stamp_ms.tolist() == middles
    assert found.count.tolist() == [len(group) for group in groups.values()]
    assert found.min.tolist() == [min(group) for group in groups.values()]
    assert found.max.tolist() == [max(group) for group in groups.values()]
    with np.errstate(invalid="ignore", over="ignore"):
        means = np.array([np.sum(group) / len(group) for group in groups.values()])
        # Near the end of what a double holds the sum of finite values depends on their order, which nobody promises.
        ordered = [np.sum(np.abs([v for v in group if np.isfinite(v)])) < 1e300 for group in groups.values()]
    np.testing.assert_allclose(found.mean[ordered], means[ordered], rtol=1e-9, atol=1e-9)


STAMPS = st.integers(0, 6000)
VALUES = st.one_of(st.integers(-100, 100).map(float), st.sampled_from((NAN, INF, -INF, 1e308, -1e308, 0.1)))


@given(
    st.lists(st.tuples(STAMPS, VALUES), max_size=30),
    st.integers(0, 2500),
    st.lists(st.tuples(STAMPS, STAMPS, st.integers(1, 60)), min_size=1, max_size=4),
    st.integers(1, 30),
)
@settings(max_examples=30)
def test_every_bucket_is_exact(odd: list[Point], regular: int, asked: list[tuple[int, int, int]], merged: int) -> None:
    """Regular rows make full chunks; odd ones among them are late, no numbers, or too large to be added up."""
    rng = np.random.default_rng(regular)
    points = [(2 * number, float(value)) for number, value in enumerate(rng.integers(-50, 50, regular).tolist())]
    for number, item in enumerate(odd):
        points.insert(number * 97 % (len(points) + 1), item)
    with tempfile.TemporaryDirectory() as folder:
        engine = SqliteEngine(place_store(Path(folder)))
        engine.connection.execute("PRAGMA synchronous = OFF")
        engine.open()
        put(engine, points, merged=merged)
        for one, other, buckets in asked:
            check(engine, points, min(one, other), max(one, other) + 1, buckets)
        engine.close()


def test_buckets_on_both(engine: StoreEngine) -> None:
    rng = np.random.default_rng(5)
    points = [(int(stamp), float(value)) for stamp, value in zip(range(0, 60_000, 10), rng.normal(size=6000))]  # noqa: B905
    points[700] = (7000, NAN)
    points[1000], points[1500], points[2600] = (10_000, 1.7e308), (15_000, 1.7e308), (26_000, INF)
    points[3000] = (5, -4.0)  # late
    put(engine, points, merged=50)
    for start_ns, end_ns, buckets in (
        (0, 59_999, 3),
        (0, 59_999, 7),
        (1, 59_000, 100),
        (-(2**60), 2**60, 2),
        (4999, 5001, 5),
        (20_000, 30_000, 1),
        (0, 59_999, 10_000),
        (70_000, 80_000, 10),
    ):
        check(engine, points, start_ns, end_ns, buckets)


def test_a_line_keeps_what_stands_out(engine: StoreEngine) -> None:
    values = np.sin(np.arange(20_000) / 900)
    values[12_345], values[5001], values[3] = 5.0, -5.0, NAN
    points = [(number * 1000, float(value)) for number, value in enumerate(values)]
    put(engine, points, batch=1000, merged=15)
    found = ranged(engine, 0, 20_000_000, 100, method="lttb")
    assert len(found.count) == 100
    assert found.count.tolist() == [1] * 100
    rows = {stamp_ns / 1e6: value for stamp_ns, value in points}
    assert all(rows[stamp] == value for stamp, value in zip(found.stamp_ms, found.mean, strict=True))
    assert found.stamp_ms.tolist() == sorted(set(found.stamp_ms.tolist()))
    assert (found.max.max(), found.min.min()) == (5.0, -5.0)
    few = ranged(engine, 0, 50_000, 100, method="lttb")
    assert few.mean.tolist() == [value for _, value in points[:51] if not np.isnan(value)]
    assert len(ranged(engine, -10, -5, 100, method="lttb").count) == 0


def test_a_line_holds_no_row_twice(engine: StoreEngine) -> None:
    put(engine, [(number, 1.0) for number in range(6000)])
    found = ranged(engine, 0, 6_000_000, 20, method="lttb")
    assert found.stamp_ms.tolist() == sorted(set(found.stamp_ms.tolist()))
    assert set(found.mean.tolist()) == {1.0}


def test_chunks_of_an_earlier_program_are_read(engine: StoreEngine) -> None:
    points = [(number, float(number % 17)) for number in range(3000)]
    put(engine, points)
    with engine.transaction(write=True):
        chunks = engine.fetch("SELECT chunk, first_ns, count FROM metric_chunks WHERE first_ns < 1200")
        for number, first, count in chunks:
            stamps = np.arange(first, first + count, dtype=np.int64)
            engine.execute(
                "UPDATE metric_chunks SET encoding = ?, stamps = ?, vals = ?, valid = NULL, low = NULL, high = NULL,"
                " total = NULL, low_ns = NULL, high_ns = NULL WHERE chunk = ?",
                PLAIN,
                stamps.tobytes(),
                (stamps % 17).astype(np.float64).tobytes(),
                number,
            )
    assert len(chunks) == 3
    check(engine, points, 0, 2999, 4)
    check(engine, points, 100, 2000, 40)
    assert len(ranged(engine, 0, 2999, 100, method="lttb").count) == 100
    assert everything(engine, "host.cpu") == [(float(stamp), value) for stamp, value in points]


def test_a_damaged_chunk_is_named_and_the_rest_is_read(engine: StoreEngine) -> None:
    rng = np.random.default_rng(6)
    points = [(number, float(np.float32(value))) for number, value in enumerate(np.cumsum(rng.normal(size=2100)))]
    put(engine, points)
    with engine.transaction(write=True):
        for first in (500, 2000):
            engine.execute("UPDATE metric_chunks SET vals = ? WHERE first_ns = ?", b"\x34nonsense", first)
    found = ranged(engine, 0, 2099, 5000)
    assert found.damaged == [(500, 999, 500), (2000, 2099, 100)]
    assert found.mean.tolist() == [value for stamp, value in points if not 500 <= stamp < 1000 and stamp < 2000]
    assert ranged(engine, 0, 450, 5000).damaged == []
    (facts,) = read_series(engine, "r1")
    assert (facts.samples, facts.value) == (2100, None)
    Committer(engine).commit([write(2101, (CPU, 2100, 7.0))], now_ns=1)  # rows go on to be taken
    assert merge_step(engine, max_batches=9) == 1
    assert ranged(engine, 2100, 2200, 5).mean.tolist() == [7.0]


def test_newest_rows_and_counts(engine: StoreEngine) -> None:
    put(engine, [(number, float(number)) for number in range(1200)])
    Committer(engine).commit([write(1202, (CPU, 5000, 1.5), (BATTERY, 5001, 2.5))], now_ns=1)
    facts = {item.series.name: (item.samples, item.stamp_ns, item.value) for item in read_series(engine, "r1")}
    assert facts == {"host.cpu": (1201, 5000, 1.5), "battery": (1, 5001, 2.5)}
    merge_step(engine, max_batches=9)
    facts = {item.series.name: (item.samples, item.stamp_ns, item.value) for item in read_series(engine, "r1")}
    assert facts == {"host.cpu": (1201, 5000, 1.5), "battery": (1, 5001, 2.5)}


@pytest.mark.parametrize(("limit", "numbers"), [(9, [1, 4]), (1, [4])])
def test_losses_of_metric_rows(engine: StoreEngine, limit: int, numbers: list[int]) -> None:
    Committer(engine).commit(
        [
            gap_write(1, 3, stream_id=0),
            gap_write(4, 4, stream_id=BACKFILL_BIT, base=3),
            gap_write(7, 9, stream_id=8, base=6),
            run_write(1, [b"x"]),
        ],
        now_ns=1,
    )
    assert [gap.from_seq for gap in read_metric_gaps(engine, "r1", start_ns=2, end_ns=9, limit=limit)] == numbers
    assert read_metric_gaps(engine, "r1", start_ns=3, end_ns=9, limit=limit) == []
    assert read_metric_gaps(engine, "r2", start_ns=0, end_ns=9, limit=limit) == []
