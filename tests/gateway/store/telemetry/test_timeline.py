"""Counts by bucket: exact sums, and where they lie, on both databases."""

from __future__ import annotations

from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.telemetry.merge import merge_step
from gateway.store.telemetry.timeline import read_density
from tests.gateway.store.samples import CPU, run_write, write

RANGE = {"start_ns": 1000, "end_ns": 2000, "buckets": 10}


def test_nothing_is_stored(engine: StoreEngine) -> None:
    density = read_density(engine, "nobody", **RANGE)
    assert density.width_ns == 100
    assert density.messages.tolist() == density.rows.tolist() == [0] * 10


def test_messages_lie_where_their_batches_do(engine: StoreEngine) -> None:
    committer = Committer(engine)
    first = run_write(1, [b"x"] * 50, stamp_ns=1000)  # stamps 1001 to 1050
    wide = run_write(51, [b"x"] * 400, stamp_ns=1149)  # 1200 to 1599
    outside = run_write(451, [b"x"] * 9, stamp_ns=5000)
    committer.commit([first, wide, outside, run_write(1, [b"x"], robot="r2")], now_ns=1)
    density = read_density(engine, "r1", **RANGE)
    assert density.messages.tolist() == [50, 0, 100, 100, 100, 100, 0, 0, 0, 0]
    one = read_density(engine, "r1", start_ns=0, end_ns=10_000, buckets=1)
    assert one.messages.tolist() == [459]


def test_a_batch_across_the_border_counts_for_its_part(engine: StoreEngine) -> None:
    Committer(engine).commit([run_write(1, [b"x"] * 400, stamp_ns=799)], now_ns=1)  # 800 to 1199
    density = read_density(engine, "r1", **RANGE)
    assert 180 <= density.messages.sum() <= 280
    assert density.messages[2:].sum() == 0


def test_rows_count_before_and_after_their_merge(engine: StoreEngine) -> None:
    rows = [(CPU, 1000 + 10 * n, 1.0) for n in range(100)]
    Committer(engine).commit([write(100, *rows), write(1, (CPU, 1500, 1.0), robot="r2")], now_ns=1)
    assert read_density(engine, "r1", **RANGE).rows.tolist() == [10] * 10
    merge_step(engine, max_batches=10)
    assert read_density(engine, "r1", **RANGE).rows.sum() == 100
