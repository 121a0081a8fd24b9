"""Merging, reading ranges, retention and migrations; on both databases."""

from __future__ import annotations

import sqlite3
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.errors import StoreError
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.purge import Purge
from gateway.store.retention import Retention
from gateway.store.schema import CHUNK_SAMPLES
from gateway.store.sqlite import SqliteEngine
from gateway.store.telemetry.merge import do_merge, merge_step, plan_merge, waiting_batches
from gateway.store.telemetry.query import read_gaps, read_series, read_streams
from gateway.store.telemetry.samples import SampleFilter
from gateway.store.telemetry.series import read_range
from tests.gateway.store.samples import BATTERY, CPU, EPOCH, everything, gap_write, read_samples, run_write, write
from tests.support.servers.sqlite_store import place_store

Batches = list[list[tuple[bool, int]]]
DAY_NS = 86400 * 10**9


def check_merge(engine: StoreEngine, batches: Batches, choose: Callable[[int], int]) -> None:
    """Every row is there once, before, during and after; `choose(n)` is a number below n."""
    committer = Committer(engine)
    expected: dict[str, list[int]] = {"host.cpu": [], "battery": []}
    seq = 0
    for batch in batches:
        items = [(CPU if cpu else BATTERY, stamp, float(stamp)) for cpu, stamp in batch]
        seq += len(items)
        committer.commit([write(seq, *items)], now_ns=seq)
        for series, stamp, _ in items:
            expected[series.name].append(stamp)
        if choose(2):
            merge_step(engine, max_batches=1 + choose(4))
        for name, stamps in expected.items():
            assert [stamp for stamp, _ in everything(engine, name)] == sorted(stamps)
    while merge_step(engine, max_batches=2):
        pass
    assert waiting_batches(engine) == (0, 0)
    for name, stamps in expected.items():
        assert everything(engine, name) == [(float(s), float(s)) for s in sorted(stamps)]
    with engine.transaction(write=False):
        counts = [row[0] for row in engine.fetch("SELECT count FROM metric_chunks")]
        assert sum(counts) == seq
        assert max(counts, default=0) <= CHUNK_SAMPLES
        open_chunks = "SELECT count(*) FROM metric_chunks WHERE count < ? GROUP BY series"
        unfilled = engine.fetch(open_chunks, CHUNK_SAMPLES)
        assert all(row[0] == 1 for row in unfilled)


@given(st.lists(st.integers(1, 400), max_size=12), st.sampled_from((1, 20, 5000)), st.integers(0, 2**32))
@settings(max_examples=15)
def test_merge_keeps_every_row_once(sizes: list[int], stamps: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    batches = [[(bool(rng.integers(2)), int(rng.integers(stamps))) for _ in range(size)] for size in sizes]
    with tempfile.TemporaryDirectory() as folder:
        engine = SqliteEngine(place_store(Path(folder)))
        engine.connection.execute("PRAGMA synchronous = OFF")
        engine.open()
        check_merge(engine, batches, lambda below: int(rng.integers(below)))
        engine.close()


def test_merge_on_both(engine: StoreEngine) -> None:
    rng = np.random.default_rng(7)
    batches = [[(bool(rng.integers(2)), int(rng.integers(5000))) for _ in range(300)] for _ in range(15)]
    check_merge(engine, batches, lambda below: int(rng.integers(below)))


def test_two_who_merge_a_shared_store_move_every_row_once(connect: Callable[[], StoreEngine]) -> None:
    one, two = connect(), connect()
    committer = Committer(one)
    for first in range(0, 4000, 100):
        committer.commit([write(first + 100, *[(CPU, first + i, 1.0) for i in range(100)])], now_ns=1)
    while merge_step(one, max_batches=3) + merge_step(two, max_batches=5):
        pass
    assert [stamp for stamp, _ in everything(two, "host.cpu")] == list(range(4000))


def test_a_merge_that_comes_too_late_does_nothing(engine: StoreEngine) -> None:
    committer = Committer(engine)
    for first in range(0, 1200, 100):
        committer.commit([write(first + 100, *[(CPU, first + i, 1.0) for i in range(100)])], now_ns=1)
        with engine.transaction(write=True):
            late = plan_merge(engine, max_batches=2)
        if first % 300 == 200:
            gone = merge_step(engine, max_batches=1)  # the batch, or the chunk, is another one by now
            with engine.transaction(write=True):
                assert (gone, do_merge(engine, late)) == (1, 0)
    while merge_step(engine, max_batches=3):
        pass
    assert [stamp for stamp, _ in everything(engine, "host.cpu")] == list(range(1200))


def test_buckets_agree_with_numpy(engine: StoreEngine) -> None:
    rng = np.random.default_rng(1)
    stamps, values = np.arange(5000), rng.normal(size=5000)
    values[17] = np.nan
    committer = Committer(engine)
    for start in range(0, 5000, 500):
        items = [
            (CPU, int(s), float(v))
            for s, v in zip(stamps[start : start + 500], values[start : start + 500], strict=True)
        ]
        committer.commit([write(start + 500, *items)], now_ns=1)
    merge_step(engine, max_batches=7)
    (piece,) = read_range(engine, "r1", ["host.cpu"], start_ns=0, end_ns=4999, points=50)
    assert piece.count.tolist() == [99] + [100] * 49
    np.testing.assert_allclose(piece.mean, [np.nanmean(values[i : i + 100]) for i in range(0, 5000, 100)])
    np.testing.assert_allclose(piece.max, [np.nanmax(values[i : i + 100]) for i in range(0, 5000, 100)])
    np.testing.assert_allclose(piece.min, [np.nanmin(values[i : i + 100]) for i in range(0, 5000, 100)])
    (none,) = read_range(engine, "r1", ["nothing"], start_ns=0, end_ns=4999, points=50)
    assert len(none.count) == 0
    (facts,) = read_series(engine, "r1")
    assert (facts.samples, facts.stamp_ns) == (5000, 4999)


def purge(engine: StoreEngine, retention: Retention, *, now_ns: int) -> int:
    """A whole purge; how many rows went."""
    step = Purge(engine, retention, now_ns=now_ns)
    total = 0
    while deleted := step.step():
        total += deleted
    return total


def fill(engine: StoreEngine, days: int) -> None:
    """A chunk, a bulk batch, an event and a gap a day."""
    committer = Committer(engine)
    for day in range(days):
        bulk = run_write(day + 1, [b"b" * 5000], stream_id=8, topic="/scan", delivery="bulk")
        writes = [write(1000 * (day + 1), *[(CPU, i, 1.0) for i in range(1000)]), bulk]
        writes += [run_write(2 * day + 1, [b"event"]), gap_write(2 * day + 2, 2 * day + 2)]
        committer.commit(writes, now_ns=day * DAY_NS)
        merge_step(engine, max_batches=10)


def kept(engine: StoreEngine) -> tuple[int, int, int, int]:
    """How many rows, bulk samples, events and gaps are left."""
    samples = sum(item.samples for item in read_series(engine, "r1"))
    bulk, events = (
        sum(batch.count for batch in read_samples(engine, "r1", SampleFilter(topic=topic), limit=1000))
        for topic in ("/scan", "/events")
    )
    return samples, bulk, events, len(read_gaps(engine, "r1", limit=1000))


def test_retention_by_age_keeps_events_longest(engine: StoreEngine) -> None:
    fill(engine, 10)
    retention = Retention(age_s=86400 * 2.5, event_age_s=86400 * 5.5, size_bytes=1 << 40)
    now_ns = 9 * DAY_NS
    assert purge(engine, retention, now_ns=now_ns) > 0
    assert kept(engine) == (3000, 3, 6, 6)
    assert purge(engine, retention, now_ns=now_ns) == 0
    assert purge(engine, Retention(age_s=1, size_bytes=1 << 40), now_ns=1000 * DAY_NS) > 0
    assert kept(engine) == (0, 0, 0, 0)
    assert read_streams(engine, "r1") == {(0, EPOCH): 10_000, (7, EPOCH): 20, (8, EPOCH): 10}


def test_retention_by_size_takes_the_oldest_and_events_last(engine: StoreEngine) -> None:
    fill(engine, 10)
    used = engine.used_bytes()
    now_ns = 9 * DAY_NS
    assert purge(engine, Retention(age_s=1e9, size_bytes=used + 1), now_ns=now_ns) == 0
    assert purge(engine, Retention(age_s=1e9, size_bytes=used - 15_000), now_ns=now_ns) > 0
    samples, bulk, events, gaps = kept(engine)
    assert 5000 <= samples < 10_000
    assert 5 <= bulk < 10
    assert (events, gaps) == (10, 10)
    assert {batch.first_seq for batch in read_samples(engine, "r1", SampleFilter(stream_id=8), limit=99)} == set(
        range(11 - bulk, 11)
    )
    purge(engine, Retention(age_s=1e9, size_bytes=1), now_ns=now_ns)
    samples, bulk, events, gaps = kept(engine)
    assert (samples, bulk, gaps) == (0, 0, 10)
    assert read_streams(engine, "r1") == {(0, EPOCH): 10_000, (7, EPOCH): 20, (8, EPOCH): 10}


def test_deleted_numbers_never_come_back(engine: StoreEngine) -> None:
    fill(engine, 2)
    purge(engine, Retention(age_s=1, size_bytes=1 << 40), now_ns=1000 * DAY_NS)
    Committer(engine).commit([run_write(1, [b"event", b"x", b"event"])], now_ns=1)
    assert kept(engine) == (0, 0, 0, 0)


def test_a_newer_schema_is_refused(engine: StoreEngine) -> None:
    if isinstance(engine, SqliteEngine):
        engine.connection.execute("PRAGMA user_version = 99")
    else:
        with engine.transaction(write=True):
            engine.execute("INSERT INTO metaros_schema VALUES (99)")
    with pytest.raises(StoreError, match="schema 99"):
        engine.open()


def test_a_store_of_an_earlier_program_is_brought_up_to_date(tmp_path: Path) -> None:
    old = sqlite3.connect(tmp_path / "gateway.sqlite")
    from gateway.store.schema import migration
    from gateway.store.sqlite import DIALECT

    old.executescript(f"{migration(0, DIALECT)} PRAGMA user_version = 1;")
    old.execute("INSERT INTO meta VALUES ('store_id', 'kept')")
    old.execute("INSERT INTO robots VALUES (3, 'r1', '/', '', '', '{}', 1, 1)")
    old.execute("INSERT INTO streams VALUES (3, 7, -3, 41, 1)")
    old.commit()
    old.close()
    engine = SqliteEngine(tmp_path)
    assert engine.open() == "kept"
    Committer(engine).commit([run_write(41, [b"x", b"new"])], now_ns=1)
    assert read_streams(engine, "r1") == {(7, EPOCH): 42}
    assert [batch.first_seq for batch in read_samples(engine, "r1", SampleFilter(), limit=9)] == [42]
    engine.close()


def test_the_tables_of_both_are_the_same(tmp_path: Path, engine: StoreEngine) -> None:
    with engine.transaction(write=False):
        if isinstance(engine, SqliteEngine):
            tables = {row[0] for row in engine.fetch("SELECT name FROM sqlite_master WHERE type = 'table'")}
        else:
            query = "SELECT table_name FROM information_schema.tables WHERE table_schema = current_schema()"
            tables = {row[0] for row in engine.fetch(query)} - {"metaros_schema"}
    assert tables == {
        "alert_checks",
        "alert_notices",
        "alert_remarks",
        "alerts",
        "api_keys",
        "audit",
        "audit_head",
        "authorities",
        "certificates",
        "enrolment_tokens",
        "event_head",
        "events",
        "identity_changes",
        "robot_identities",
        "channels",
        "gaps",
        "gateways",
        "login_failures",
        "meta",
        "metric_batches",
        "made_once",
        "metric_chunks",
        "metric_levels",
        "objects",
        "commands",
        "presence",
        "watch_states",
        "recordings",
        "robots",
        "rollout_robots",
        "rollouts",
        "duties",
        "node_leases",
        "update_bundles",
        "update_keys",
        "update_metadata",
        "sample_batches",
        "segment_runs",
        "segments",
        "series",
        "sessions",
        "sign_in_links",
        "streams",
        "template_history",
        "templates",
        "twin_changes",
        "twin_documents",
        "twin_history",
        "twin_reports",
        "twins",
        "users",
        "writers",
        "silences",
        "hooks",
        "rule_fires",
        "rule_head",
        "rule_history",
        "rule_secrets",
        "rule_states",
        "rule_stats",
        "rules",
        "deliveries",
        "function_canaries",
        "happenings",
        "invocations",
        "lambda_changes",
        "lambda_code",
        "lambda_records",
        "mapping_cursors",
        "mapping_starts",
        "queue_totals",
        "replays",
    }
