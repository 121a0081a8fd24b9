"""Levels against brute force, on both databases: what they hold, when they are made, and when they go."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from gateway.domain.sample import Rows
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.purge import Purge
from gateway.store.retention import Retention
from gateway.store.schema import CHUNK_SAMPLES
from gateway.store.telemetry.buckets import BucketDownsampler, Span
from gateway.store.telemetry.chunks import Stamps, Values
from gateway.store.telemetry.levels import LEVEL_CHUNKS, SETTLED_NS, LevelBuilder, cells_of, read_levels
from gateway.store.telemetry.merge import merge_step
from gateway.store.telemetry.series import read_range
from gateway.store.writes import StreamWrite
from tests.gateway.store.samples import CPU, EPOCH

S = 10**9
ROWS = LEVEL_CHUNKS * CHUNK_SAMPLES
NOW_NS = 10 * SETTLED_NS
GRID_NS = 1 << 62


def put(engine: StoreEngine, stamps: Stamps, values: Values, *, now_ns: int = 1) -> None:
    """Store rows and merge them into chunks."""
    with engine.transaction(write=False):
        seq = sum(int(row[0]) for row in engine.fetch("SELECT seq FROM streams"))
    series = np.zeros(len(stamps), np.uint32)
    rows = Rows((CPU,), series, stamps.astype(np.int64), values.astype(np.float64))
    whole = StreamWrite(robot="r1", seq=seq + len(stamps), stream_id=0, epoch=EPOCH, rows=rows)
    Committer(engine).commit([whole], now_ns=now_ns)
    assert merge_step(engine, max_batches=1) == 1


def build(engine: StoreEngine, *, now_ns: int = NOW_NS) -> None:
    builder = LevelBuilder(engine, now_ns=now_ns)
    while builder.step():
        pass


def held(engine: StoreEngine) -> list[tuple[int, int]]:
    """Between which numbers the chunks lie that have a level."""
    with engine.transaction(write=False):
        return read_levels(engine, 1, start_ns=-GRID_NS, end_ns=GRID_NS, grid_ns=GRID_NS)[1]


def check(engine: StoreEngine, stamps: Stamps, values: Values, start_ns: int, end_ns: int, points: int) -> None:
    """What is read is what a loop over the rows finds, in buckets that begin at multiples of their width."""
    (found,) = read_range(engine, "r1", ["host.cpu"], start_ns=start_ns, end_ns=end_ns, points=points)
    inside = (stamps >= start_ns) & (stamps <= end_ns) & ~np.isnan(values)
    stamps, values = stamps[inside], values[inside]
    width_ns = BucketDownsampler(Span(start_ns=start_ns, end_ns=end_ns, points=points)).width_ns
    places = stamps // width_ns
    order = np.argsort(places, kind="stable")
    groups = np.split(values[order], np.flatnonzero(np.diff(places[order])) + 1)
    assert points * 6 // 7 - 1 <= len(groups) <= points
    assert found.count.tolist() == [len(group) for group in groups]
    assert found.min.tolist() == [group.min() for group in groups]
    assert found.max.tolist() == [group.max() for group in groups]
    with np.errstate(invalid="ignore"):
        np.testing.assert_allclose(found.mean, [group.mean() for group in groups], rtol=1e-9)
    begin_ns = np.unique(places) * width_ns
    middles = (np.maximum(begin_ns, start_ns) + np.minimum(begin_ns + width_ns, end_ns + 1)) / 2e6
    np.testing.assert_allclose(found.stamp_ms, middles, rtol=0, atol=1e-3)


@pytest.fixture
def odd() -> tuple[Stamps, Values]:
    """Two levels and some more of rows at 100 Hz, with no numbers, infinite and late ones among them."""
    rng = np.random.default_rng(3)
    count = 2 * ROWS + 700
    stamps = 1_790_000_000 * S + np.arange(count) * S // 100 + rng.integers(0, S // 100, count)
    values = rng.normal(size=count)
    values[5::91], values[40_000], values[41_000:42_000] = np.nan, np.inf, np.nan
    stamps[20_000:20_900] = stamps[70:970]  # a clock that was set back
    stamps[50_000:50_400] = stamps[12_000:12_400] + 1
    return stamps, values


def test_ranges_of_levels_are_exact(engine: StoreEngine, odd: tuple[Stamps, Values]) -> None:
    stamps, values = odd
    put(engine, stamps, values)
    first, last = int(stamps.min()), int(stamps.max())
    asked = [
        (first, last, 60),
        (first - 7 * S, last + 9 * S, 40),
        (first + 3 * S + 17, last - 2 * S, 33),
        (first + 200 * S, last + 1, 50),  # the first level is cut
        (first + 100 * S, first + 500 * S, 35),
        (first - 5 * S, last - 100 * S, 32),
    ]
    for one in asked:
        check(engine, stamps, values, *one)
    assert held(engine) == []
    build(engine)
    assert len(held(engine)) == 1  # both, with nothing between them
    for one in asked:
        check(engine, stamps, values, *one)
    build(engine)
    assert len(held(engine)) == 1
    more = last + np.arange(1, ROWS) * S // 100
    put(engine, more, np.ones(len(more)))  # what is not full, or came after, is read from its chunks
    for one in asked:
        check(engine, np.append(stamps, more), np.append(values, np.ones(len(more))), *one)


def test_a_level_goes_with_its_first_chunk(engine: StoreEngine, odd: tuple[Stamps, Values]) -> None:
    stamps, values = odd
    put(engine, stamps[:500], values[:500], now_ns=1)
    put(engine, stamps[500:], values[500:], now_ns=2 * SETTLED_NS)
    build(engine)
    before = held(engine)
    purge = Purge(engine, Retention(age_s=3600, size_bytes=1 << 40), now_ns=3600 * S + SETTLED_NS)
    while purge.step():
        pass
    assert held(engine) == [(before[0][0] + LEVEL_CHUNKS, before[0][1])]
    check(engine, stamps[500:], values[500:], int(stamps.min()), int(stamps.max()), 60)
    build(engine)
    assert len(held(engine)) == 1


def test_young_chunks_and_damaged_ones_have_no_level(engine: StoreEngine) -> None:
    stamps, values = np.arange(ROWS) * S // 10, (np.arange(ROWS) % 17).astype(np.float64)
    put(engine, stamps, values, now_ns=NOW_NS - SETTLED_NS + 1)
    build(engine)
    assert held(engine) == []
    with engine.transaction(write=True):
        engine.execute("UPDATE metric_chunks SET vals = ? WHERE first_ns = 0", b"\x34nonsense")
    build(engine, now_ns=NOW_NS + 1)
    assert held(engine) == []
    (found,) = read_range(engine, "r1", ["host.cpu"], start_ns=1, end_ns=int(stamps[-1]), points=60)
    assert [item[2] for item in found.damaged] == [CHUNK_SAMPLES]
    assert found.count.sum() == ROWS - CHUNK_SAMPLES
    put(engine, stamps + 10**15, values)  # the ones behind it have theirs
    build(engine, now_ns=NOW_NS + 1)
    assert len(held(engine)) == 1
    check(engine, stamps + 10**15, values, 10**15, 10**15 + int(stamps[-1]), 60)


@pytest.mark.parametrize("first_ns", [-77 * S, 0, 1_790_000_000 * S + 1])
def test_cells_hold_every_number_once(first_ns: int) -> None:
    rng = np.random.default_rng(2)
    for span_ns, count in itertools.product((0, 1, 127, 128, 10**6 + 1, 10**13), (1, 3, 900)):
        stamps = first_ns + rng.integers(0, span_ns + 1, count)
        values = np.where(rng.random(count) < 0.2, np.nan, rng.normal(size=count))
        shift, cells = cells_of(stamps, values)
        counts = np.frombuffer(cells, np.uint8).reshape(-1, 30)[:, 2:6].copy().view("<u4")
        assert counts.sum() == np.count_nonzero(~np.isnan(values))
        assert len(counts) <= 128
        assert (int(stamps.max()) >> shift) - (int(stamps.min()) >> shift) < 128
