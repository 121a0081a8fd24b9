"""The account of a store on both databases: its sums agree with what was written, and the plan with the purge."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.ledger import in_transaction, sweep_objects
from gateway.store.objects import DirectoryStore
from gateway.store.purge import Purge, oldest_holdings
from gateway.store.retention import CLASSES, ClassLimit, Retention
from gateway.store.storage import Storage
from gateway.store.telemetry.compact import Compaction
from gateway.store.telemetry.merge import merge_step
from metaros.clock import ManualClock
from tests.gateway.store.samples import CPU, gap_write, run_write, write

HOUR_NS = 3600 * 10**9
BLOB = bytes(range(256)) * 40
ENDLESS = Retention(age_s=1e9, size_bytes=1 << 40)


@pytest.fixture
def objects(tmp_path: Path) -> DirectoryStore:
    """An empty object store."""
    return DirectoryStore(tmp_path / "objects")


@pytest.fixture
def full(engine: StoreEngine, objects: DirectoryStore) -> StoreEngine:
    """Every hour for ten hours, of two robots: a chunk of rows, bulk and an event; the first half compacted."""
    committer = Committer(engine)
    work = Compaction(engine, in_transaction(engine), objects, clock=ManualClock())
    for hour in range(10):
        writes = []
        for robot, count in (("r1", 1), ("r2", 2)):
            writes += [
                write(1000 * (hour + 1), *[(CPU, i, float(i)) for i in range(1000)], robot=robot),
                run_write(hour * count + 1, [BLOB] * count, robot=robot, stream_id=8, topic="/scan", delivery="bulk"),
                run_write(2 * hour + 1, [b"event"], robot=robot),
                gap_write(2 * hour + 2, 2 * hour + 2, robot=robot),
            ]
        committer.commit(writes, now_ns=hour * HOUR_NS)
        merge_step(engine, max_batches=10)
        if hour < 5:
            for due in work.due(everything=True):
                work.compact(due)
    return engine


def account(objects: DirectoryStore, tmp_path: Path, retention: Retention = ENDLESS) -> Storage:
    """The account of the store."""
    return Storage(retention=retention, objects=objects, data_dir=tmp_path)


def test_sums(full: StoreEngine, objects: DirectoryStore, tmp_path: Path) -> None:
    document = account(objects, tmp_path).document(full, now_ns=10 * HOUR_NS)
    held = sum(info.size_bytes for info in objects.names())
    assert document["objects"] == {
        "where": str(tmp_path / "objects"),
        "stored": 20,
        "bytes": held,
        "uploading": 0,
        "doomed": 0,
    }
    assert document["total_bytes"] == full.used_bytes() + held
    sizes = {item["class"]: item["bytes"] for item in document["classes"]}
    assert sizes["bulk"] > 3 * 5 * len(BLOB)  # what is not compacted is as large as it came
    assert 0 < sizes["event"] < sizes["bulk"]
    assert sizes["metric"] > 0
    assert sizes["recording"] == 0
    assert sum(item["bytes"] for item in document["robots"]) == sum(sizes.values())
    assert [item["robot"] for item in document["robots"]] == ["r2", "r1"]
    rows = {item["table"]: item["rows"] for item in document["tables"]}
    assert (rows["sample_batches"], rows["segments"], rows["segment_runs"], rows["gaps"]) == (20, 20, 20, 20)
    assert {item["class"]: item["oldest"] for item in document["classes"]} == {
        "metric": "1970-01-01T00:00:00.000Z",
        "bulk": "1970-01-01T00:00:00.000Z",
        "event": "1970-01-01T00:00:00.000Z",
        "recording": None,
    }
    assert (document["damaged"], document["checked"]) == ([], None)


def test_growth_is_what_a_day_brings(full: StoreEngine, objects: DirectoryStore, tmp_path: Path) -> None:
    it = account(objects, tmp_path)
    document = it.document(full, now_ns=10 * HOUR_NS)
    held = sum(item["bytes"] for item in document["classes"])
    assert document["growth_bytes_per_day"] == pytest.approx(held * 2.4, rel=0.01)
    assert document["days_until_bound"] is None  # its age holds it before
    bound = Retention(age_s=1e9, size_bytes=document["total_bytes"] + held * 24)
    near = account(objects, tmp_path, bound).document(full, now_ns=10 * HOUR_NS)
    assert near["days_until_bound"] == pytest.approx(10, rel=0.01)
    assert near["days_until_full"] is None
    assert it.document(full, now_ns=100 * HOUR_NS)["growth_bytes_per_day"] == 0
    early = it.document(full, now_ns=HOUR_NS // 2)
    assert (early["growth_bytes_per_day"], early["days_until_full"], early["days_until_bound"]) == (None, None, None)


def test_an_empty_store(engine: StoreEngine, objects: DirectoryStore, tmp_path: Path) -> None:
    it = account(objects, tmp_path / "not" / "there")
    document = it.document(engine, now_ns=HOUR_NS)
    assert [item["bytes"] for item in document["classes"]] == [0, 0, 0, 0]
    assert document["growth_bytes_per_day"] is None
    assert document["disk_free_bytes"] > 0
    assert it.plan_document(engine, now_ns=HOUR_NS) == {"items": [], "bytes": 0, "gaps": 0}


def left(engine: StoreEngine) -> dict[str, list[int]]:
    """The hours of what is left of each class."""
    return {name: [item.stored_ns // HOUR_NS for item in oldest_holdings(engine, name)] for name in CLASSES}


@pytest.mark.parametrize(
    ("retention", "expected"),
    [
        (
            Retention(age_s=3 * 3600, event_age_s=6 * 3600, size_bytes=1 << 40),
            {("bulk", "age"): 14, ("event", "age"): 8},
        ),
        (
            Retention(age_s=1e9, size_bytes=1 << 40, classes={"bulk": ClassLimit(age_s=5 * 3600, size_bytes=70_000)}),
            {("bulk", "age"): 10, ("bulk", "class_size"): 6},
        ),
        (Retention(age_s=1e9, size_bytes=1), {("bulk", "store_size"): 20}),
    ],
)
def test_the_purge_deletes_what_the_plan_says(
    full: StoreEngine,
    objects: DirectoryStore,
    tmp_path: Path,
    retention: Retention,
    expected: dict[tuple[str, str], int],
) -> None:
    before, now_ns = left(full), 10 * HOUR_NS
    document = account(objects, tmp_path, retention).plan_document(full, now_ns=now_ns)
    planned = {(item["class"], item["why"]): item["count"] for item in document["items"]}
    assert {key: planned[key] for key in expected} == expected
    assert left(full) == before
    purge = Purge(full, retention, now_ns=now_ns)
    deleted = 0
    while count := purge.step():
        deleted += count
    assert deleted == sum(planned.values()) + document["gaps"]
    after = left(full)
    for name in CLASSES:
        gone = sum(count for (kind, _), count in planned.items() if kind == name)
        assert after[name] == before[name][gone:]
    sweep_objects(in_transaction(full), objects, now_ns=now_ns)
    with full.transaction(write=False):
        known = {row[0] for row in full.fetch("SELECT object FROM segments")}
    assert {info.name for info in objects.names()} == known


def test_two_who_purge_at_once_delete_once(
    full: StoreEngine, connect: Callable[[], StoreEngine], objects: DirectoryStore
) -> None:
    retention, other = Retention(age_s=3600, size_bytes=1 << 40), connect()
    purges = [Purge(engine, retention, now_ns=10 * HOUR_NS) for engine in (full, other)]
    while sum(purge.step() for purge in purges):  # turn about
        pass
    assert {name: sorted(set(hours)) for name, hours in left(full).items()} == {
        "metric": [9],
        "bulk": [9],
        "event": [9],
        "recording": [],
    }
    sweep_objects(in_transaction(full), objects, now_ns=10 * HOUR_NS)
    assert list(objects.names()) == []
