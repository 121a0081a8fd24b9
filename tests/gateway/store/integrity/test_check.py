"""The check on both databases and both object stores: it names what was broken on purpose, and nothing else."""

from __future__ import annotations

import hashlib
import io

import numpy as np
import pytest

from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.integrity.check import Damage, Report, check, delete_orphans, last_report, remember
from gateway.store.ledger import announce, doom, in_transaction, stored, sweep_objects
from gateway.store.object_store_marker import check_marker
from gateway.store.objects import ObjectStore
from gateway.store.purge import Purge
from gateway.store.retention import Retention
from gateway.store.telemetry.compact import Compaction
from gateway.store.telemetry.merge import merge_step
from metaros.clock import ManualClock
from tests.gateway.store.samples import CPU, gap_write, run_write, write

NOW_NS = 10**18


def fill(engine: StoreEngine, objects: ObjectStore) -> None:
    """Two streams of a robot, half of them in two segments, half still in batches."""
    committer = Committer(engine)
    for first in (1, 21):
        writes = [run_write(number, [b"e" * 50] * 5) for number in range(first, first + 10, 5)]
        writes += [gap_write(first + 10, first + 14), run_write(first + 15, [b"e"] * 5)]
        writes += [run_write(first, [b"s" * 900] * 20, stream_id=8, topic="/scan", delivery="bulk")]
        committer.commit(writes, now_ns=first)
        if first == 1:
            work = Compaction(engine, in_transaction(engine), objects, clock=ManualClock())
            assert [work.compact(due) > 0 for due in work.due(everything=True)] == [True, True]


@pytest.fixture
def full(engine: StoreEngine, objects: ObjectStore) -> StoreEngine:
    """A store with something of everything."""
    fill(engine, objects)
    return engine


def look(engine: StoreEngine, objects: ObjectStore, *, deep: bool = True) -> Report:
    """A check."""
    return check(engine, objects, deep=deep, now_ns=NOW_NS)


def segment(engine: StoreEngine, *, event: int) -> str:
    """The name of the object of one of the two segments."""
    with engine.transaction(write=False):
        return str(engine.fetch("SELECT object FROM segments WHERE event = ?", event)[0][0])


def change(engine: StoreEngine, sql: str, *values: object) -> None:
    """Break something."""
    with engine.transaction(write=True):
        assert engine.execute(sql, *values) > 0


def test_a_sound_store_empty_and_full(engine: StoreEngine, objects: ObjectStore) -> None:
    report = look(engine, objects)
    assert (report.objects, report.streams, report.damage, report.orphans) == (0, 0, [], [])
    fill(engine, objects)
    report = look(engine, objects)
    assert (report.objects, report.streams, report.damage, report.orphans) == (2, 2, [], [])
    assert report.size_bytes == sum(info.size_bytes for info in objects.names())


def put(objects: ObjectStore, name: str, data: bytes) -> None:
    """Keep some bytes, whatever the ledger says."""
    objects.put(name, io.BytesIO(data), size_bytes=len(data), sha256=hashlib.sha256(data).hexdigest())


def damages(report: Report) -> list[tuple[str, str | None, str | None]]:
    """What, object and topic of each."""
    return [(item.what, item.object, item.topic) for item in report.damage]


def test_a_broken_object_is_named_with_what_it_held(full: StoreEngine, objects: ObjectStore) -> None:
    name = segment(full, event=0)
    whole = objects.read(name)
    for broken, what, deep in (
        (None, "missing", False),
        (whole[:-9], "size", False),
        (whole + b"x", "size", False),
        (_turned(whole, 200), "corrupt", True),
        (_turned(whole, -3), "corrupt", True),
    ):
        objects.delete(name)
        if broken is not None:
            put(objects, name, broken)
        if deep:
            assert look(full, objects, deep=False).damage == []
        report = look(full, objects, deep=deep)
        (damage,) = report.damage
        assert (damage.what, damage.object, damage.robot, damage.topic) == (what, name, "r1", "/scan")
        assert (damage.first_ns, damage.last_ns) == (1001, 1020)
        assert "20 messages" in damage.detail
        assert report.orphans == []


def _turned(data: bytes, place: int) -> bytes:
    """One bit is another."""
    turned = bytearray(data)
    turned[place] ^= 1
    return bytes(turned)


def test_runs_that_do_not_match_their_object(full: StoreEngine, objects: ObjectStore) -> None:
    change(full, "UPDATE segment_runs SET size_bytes = size_bytes + 1 WHERE stream_id = 8")
    assert damages(look(full, objects)) == [("corrupt", segment(full, event=0), "/scan")]


def test_an_orphan_is_found_and_deleted_but_nobody_elses_file(full: StoreEngine, objects: ObjectStore) -> None:
    for name in ("segments/9/lost", "somebody/elses"):
        put(objects, name, b"x")
    report = look(full, objects)
    assert [item.object for item in report.orphans] == ["segments/9/lost", "somebody/elses"]
    assert report.damage == []
    run = in_transaction(full)
    assert delete_orphans(run, objects, report, now_ns=NOW_NS) == 1
    assert [item.object for item in look(full, objects).orphans] == ["somebody/elses"]
    assert look(full, objects).damage == []


def test_what_comes_and_goes_is_no_orphan(full: StoreEngine, objects: ObjectStore) -> None:
    run = in_transaction(full)
    sha256 = hashlib.sha256(b"x").hexdigest()
    for name in ("segments/1/coming", "segments/1/going"):
        run(lambda e, name=name: announce(e, name, kind="segment", now_ns=NOW_NS))  # type: ignore[misc]
        put(objects, name, b"x")
    run(lambda e: stored(e, "segments/1/going", size_bytes=1, sha256=sha256, now_ns=NOW_NS))
    assert damages(look(full, objects)) == [("unused", "segments/1/going", None)]
    run(lambda e: doom(e, "segments/1/going", NOW_NS))
    report = look(full, objects)
    assert (report.damage, report.orphans) == ([], [])


def test_the_mark_is_used_and_missed(full: StoreEngine, objects: ObjectStore) -> None:
    check_marker(full, in_transaction(full), objects, clock=ManualClock())
    assert look(full, objects).damage == []
    (mark,) = [info.name for info in objects.names("mark/")]
    objects.delete(mark)
    assert damages(look(full, objects)) == [("missing", mark, None)]


def test_a_damaged_chunk_of_a_series(full: StoreEngine, objects: ObjectStore) -> None:
    rng = np.random.default_rng(1)
    items = [(CPU, 10 * i, float(value)) for i, value in enumerate(rng.normal(size=1000))]
    Committer(full).commit([write(1000, *items)], now_ns=5)
    assert merge_step(full, max_batches=10) == 1
    assert look(full, objects).damage == []
    with full.transaction(write=True):
        number, blob = full.fetch("SELECT chunk, vals FROM metric_chunks ORDER BY chunk")[0]
        full.execute("UPDATE metric_chunks SET vals = ? WHERE chunk = ?", bytes(blob)[:-7], number)
    (damage,) = look(full, objects).damage
    assert (damage.what, damage.robot, damage.topic, damage.first_ns) == ("corrupt", "r1", "host.cpu", 0)
    assert look(full, objects, deep=False).damage == []


def test_a_ledger_that_disagrees(full: StoreEngine, objects: ObjectStore) -> None:
    name = segment(full, event=1)
    change(full, "UPDATE objects SET state = 'doomed', since_ns = ? WHERE name = ?", NOW_NS, name)
    assert damages(look(full, objects)) == [("ledger", name, "/events")]


def test_an_object_that_is_in_use_is_never_deleted_as_an_orphan(engine: StoreEngine, objects: ObjectStore) -> None:
    if engine.shared:
        return  # PostgreSQL itself keeps the row as long as something refers to it
    Committer(engine).commit([run_write(1, [b"one"])], now_ns=1)
    work = Compaction(engine, in_transaction(engine), objects, clock=ManualClock())
    assert [work.compact(due) for due in work.due(everything=True)] == [1]
    name = segment(engine, event=1)
    change(engine, "DELETE FROM objects WHERE name = ?", name)
    report = look(engine, objects)
    assert (damages(report), report.orphans) == ([("ledger", name, "/events")], [])
    assert delete_orphans(in_transaction(engine), objects, report, now_ns=NOW_NS) == 0
    assert [info.name for info in objects.names()] == [name]


def test_samples_that_are_nowhere_or_twice(full: StoreEngine, objects: ObjectStore) -> None:
    change(full, "DELETE FROM sample_batches WHERE stream_id = 7 AND first_seq = 26")
    change(full, "UPDATE segment_runs SET count = count + 1 WHERE stream_id = 8")
    report = look(full, objects, deep=False)
    assert [(item.what, item.robot, item.topic, item.detail) for item in report.damage] == [
        ("hole", "r1", "/events", "numbers 26 to 30 are neither stored nor declared lost"),
        ("twice", "r1", "/scan", "numbers 21 to 21 are there twice"),
    ]


def test_a_purged_store_is_sound(full: StoreEngine, objects: ObjectStore) -> None:
    for retention in (
        Retention(age_s=1e-9 * 10, event_age_s=1e9, size_bytes=1 << 40),
        Retention(age_s=1e9, size_bytes=1),
    ):
        purge = Purge(full, retention, now_ns=25)
        while purge.step():
            assert look(full, objects).damage == []
        sweep_objects(in_transaction(full), objects, now_ns=NOW_NS)
        report = look(full, objects)
        assert (report.damage, report.orphans) == ([], [])
        assert report.objects == len(list(objects.names()))
    assert report.objects == 0


def test_the_last_report_is_remembered(engine: StoreEngine) -> None:
    run = in_transaction(engine)
    assert run(last_report) is None
    one = Damage("missing", "gone", "segments/1/a", "r1", "/scan", 1, 2)
    for damage in ([one] * 500, [one]):
        report = Report(True, NOW_NS, 5, 6, 7, damage, [Damage("orphan", "x", "segments/1/b")])
        run(lambda e, report=report: remember(e, report))  # type: ignore[misc]
        kept = run(last_report)
        assert kept is not None
        assert kept.damage == (damage + report.orphans)[:100]
        assert (kept.checked_ns, kept.objects, kept.size_bytes, kept.streams) == (NOW_NS, 5, 6, 7)
