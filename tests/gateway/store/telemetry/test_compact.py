"""Compaction stopped after each of its steps: every message is stored once, and no object is left that nobody knows."""

from __future__ import annotations

import io
import random  # noqa: TID251 - seeded
from collections.abc import Callable

import pytest
from mcap.reader import make_reader

from gateway.errors import ObjectStoreError, PurgedError, StoreError
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.ledger import in_transaction, sweep_objects
from gateway.store.objects import ObjectStore
from gateway.store.telemetry.compact import Compaction, CompactPace
from gateway.store.telemetry.history import find_runs, stored_channels, stored_topics
from gateway.store.telemetry.load import RunLoader
from gateway.store.telemetry.query import read_streams
from gateway.store.telemetry.samples import SampleFilter
from gateway.store.writes import StreamWrite
from metaros.clock import ManualClock
from tests.gateway.store.samples import EPOCH, content, read_samples, run_write

STEPS = ("picked", "packed", "announced", "put", "checked", "deleted", "inserted", "stored", "swapped")
PACE = CompactPace(size_bytes=4000, batches=100)
LATER_NS = 3 * 600 * 10**9


class Killed(BaseException):
    """The process ends here."""


def compaction(
    engine: StoreEngine, objects: ObjectStore, on_step: Callable[[str], None] = lambda _: None
) -> Compaction:
    clock = ManualClock()
    return Compaction(engine, in_transaction(engine), objects, clock=clock, pace=PACE, on_step=on_step)


def compact_all(work: Compaction) -> int:
    """Until nothing is left that could be; how many batches went."""
    total = 0
    while moved := sum(work.compact(due) for due in work.due(everything=True)):
        total += moved
    return total


def payload(seq: int) -> bytes:
    return b"%d " % seq * (seq % 40)


def fill(engine: StoreEngine, *, batches: int = 24, seed: int = 1) -> dict[int, bytes]:
    """Batches of one to nine messages of two streams, after what was there; what stream 7 holds then."""
    rng, committer = random.Random(seed), Committer(engine)
    known = read_streams(engine, "r1")
    numbers = {stream_id: known.get((stream_id, EPOCH), 0) + 1 for stream_id in (7, 8)}
    for number in range(batches):
        writes: list[StreamWrite] = []
        for stream_id, first_seq in numbers.items():
            count = rng.randrange(1, 10)
            payloads = [payload(seq) for seq in range(first_seq, first_seq + count)]
            kind = (
                {"topic": "/events", "delivery": "event"} if stream_id == 7 else {"topic": "/scan", "delivery": "bulk"}
            )
            writes.append(run_write(first_seq, payloads, stream_id=stream_id, **kind))  # type: ignore[arg-type]
            numbers[stream_id] += count
        committer.commit(writes, now_ns=number)
    return {seq: payload(seq) for seq in range(1, numbers[7])}


def names(objects: ObjectStore) -> set[str]:
    return {info.name for info in objects.names()}


def referenced(engine: StoreEngine) -> set[str]:
    with engine.transaction(write=False):
        stored = {row[0] for row in engine.fetch("SELECT name FROM objects WHERE state = 'stored'")}
        assert stored == {row[0] for row in engine.fetch("SELECT object FROM segments")}
    return stored


def sweep(engine: StoreEngine, objects: ObjectStore) -> None:
    """The ledger's housekeeping after every lease is over; the first only gives up, the second deletes."""
    for leases in (1, 2):
        now_ns = ManualClock().wall_ns() + leases * LATER_NS
        sweep_objects(in_transaction(engine), objects, now_ns=now_ns)


def check(engine: StoreEngine, objects: ObjectStore, expected: dict[int, bytes]) -> None:
    """Everything once; every object known, every row's object there."""
    loader = RunLoader(objects)
    assert content(engine, loader=loader) == (expected, set())
    sweep(engine, objects)
    assert names(objects) == referenced(engine)
    with engine.transaction(write=False):
        assert engine.fetch("SELECT count(*) FROM objects WHERE state <> 'stored'")[0][0] == 0
    assert content(engine, loader=RunLoader(objects)) == (expected, set())


def test_a_process_killed_after_any_step(connect: Callable[[], StoreEngine], objects: ObjectStore) -> None:
    """One store, and a process for each step."""
    first, second = connect(), connect()
    for step in STEPS:
        expected = fill(first, batches=12)

        def on_step(name: str, step: str = step) -> None:
            if name == step:
                raise Killed

        with pytest.raises(Killed):
            compact_all(compaction(first, objects, on_step))
        assert content(second, loader=RunLoader(objects)) == (expected, set()), step
        check(second, objects, expected)
        assert compact_all(compaction(second, objects)) > 0, step
        check(second, objects, expected)


def test_an_error_after_any_step(engine: StoreEngine, objects: ObjectStore) -> None:
    """The same process tries again."""
    failing = ""

    def on_step(name: str) -> None:
        if name == failing:
            raise ObjectStoreError("the network is down")

    work = compaction(engine, objects, on_step)
    for step in STEPS:
        expected, failing = fill(engine, batches=12), step
        with pytest.raises(ObjectStoreError):
            compact_all(work)
        check(engine, objects, expected)
        failing = ""
        assert compact_all(work) > 0, step
        check(engine, objects, expected)
        with engine.transaction(write=False):
            assert engine.fetch("SELECT count(*) FROM sample_batches")[0][0] == 0, step


def test_a_commit_of_which_nobody_knows(engine: StoreEngine, objects: ObjectStore) -> None:
    """The connection breaks during the COMMIT of the swap, which happened: its object must not be given up."""
    expected = fill(engine)
    swapping = False

    def run(job: Callable[[StoreEngine], object], /) -> object:
        nonlocal swapping
        with engine.transaction(write=True):
            result = job(engine)
        if swapping:
            swapping = False
            raise StoreError("the connection broke, and nobody knows")
        return result

    def on_step(name: str) -> None:
        nonlocal swapping
        swapping = name == "stored"

    work = Compaction(engine, run, objects, clock=ManualClock(), pace=PACE, on_step=on_step)  # type: ignore[arg-type]
    due = work.due(everything=True)[0]
    with pytest.raises(StoreError, match="nobody knows"):
        work.compact(due)
    assert len(names(objects)) == len(referenced(engine)) == 1
    check(engine, objects, expected)
    assert len(names(objects)) == 1


def test_two_gateways_compact_the_same_batches(connect: Callable[[], StoreEngine], objects: ObjectStore) -> None:
    one, two = connect(), connect()
    expected = fill(one)
    second = compaction(two, objects)

    def on_step(name: str) -> None:
        if name == "put":  # the other one is faster, each time
            for due in second.due(everything=True):
                second.compact(due)

    first = compaction(one, objects, on_step)
    with pytest.raises(StoreError, match="somebody else"):
        compact_all(first)
    check(one, objects, expected)
    compact_all(second)
    check(two, objects, expected)


def test_batches_purged_meanwhile_and_their_numbers_used_again(engine: StoreEngine, objects: ObjectStore) -> None:
    """SQLite gives a deleted row's number to the next one: the swap must not take that for the batch it read."""
    committer = Committer(engine)
    committer.commit([run_write(1, [b"old"])], now_ns=1)

    def on_step(name: str) -> None:
        if name == "put":
            with engine.transaction(write=True):
                engine.execute("DELETE FROM sample_batches")
            Committer(engine).commit([run_write(2, [b"new"])], now_ns=1)

    with pytest.raises(StoreError, match="purged"):
        compact_all(compaction(engine, objects, on_step))
    check(engine, objects, {2: b"new"})


def test_a_reader_sees_every_message_once_at_every_step(
    connect: Callable[[], StoreEngine], objects: ObjectStore
) -> None:
    writing, reading = connect(), connect().reader()
    expected = fill(writing)
    loader, seen = RunLoader(objects), []

    def on_step(name: str) -> None:
        seen.append(name)
        assert content(reading, loader=loader) == (expected, set())

    compact_all(compaction(writing, objects, on_step))
    assert seen.count("swapped") > 3
    reading.close()


def test_a_run_that_was_compacted_or_purged_since_it_was_found(engine: StoreEngine, objects: ObjectStore) -> None:
    expected = fill(engine)
    found = find_runs(engine, "r1", SampleFilter(stream_id=7), limit=1000)
    assert all(run.place is None for run in found)
    compact_all(compaction(engine, objects))
    loader = RunLoader(objects)
    again = {seq: data for run in found for seq, _, data in loader.load(engine, run).samples()}
    assert again == expected
    after = find_runs(engine, "r1", SampleFilter(stream_id=7), limit=1000)
    assert len(after) < len(found)
    with engine.transaction(write=True):
        engine.execute("DELETE FROM segment_runs")
        engine.execute("DELETE FROM segments")
    for name in names(objects):
        objects.delete(name)
    for run in (found[0], after[0]):
        with pytest.raises(PurgedError):
            RunLoader(objects).load(engine, run)


def test_who_is_due(engine: StoreEngine, objects: ObjectStore) -> None:
    committer, clock = Committer(engine), ManualClock()
    start_ns = clock.wall_ns()
    committer.commit([run_write(1, [b"x" * 100])], now_ns=start_ns)
    committer.commit([run_write(1, [b"x" * 500], robot="big")], now_ns=start_ns)
    committer.commit([run_write(1, [b"x" * 2000], robot="full")], now_ns=start_ns)
    pace = CompactPace(size_bytes=1000, small_bytes=200, age_s=60, small_age_s=600)
    work = Compaction(engine, in_transaction(engine), objects, clock=clock, pace=pace)
    assert [due.robot_id for due in work.due()] == ["full"]
    clock.advance(61)
    assert {due.robot_id for due in work.due()} == {"full", "big"}
    clock.advance(600)
    assert {due.robot_id for due in work.due()} == {"full", "big", "r1"}


def test_stamps_that_no_mcap_file_can_hold_stay_rows(engine: StoreEngine, objects: ObjectStore) -> None:
    committer = Committer(engine)
    committer.commit([run_write(1, [b"before 1970"], stamp_ns=-1000), run_write(2, [b"after"])], now_ns=1)
    work = compaction(engine, objects)
    assert compact_all(work) == 1
    assert work.due(everything=True) == []
    check(engine, objects, {1: b"before 1970", 2: b"after"})


def test_what_one_commit_stored_goes_into_one_segment(engine: StoreEngine, objects: ObjectStore) -> None:
    """Retention deletes by the time of storing: a commit cut in two could lose its later half first."""
    committer = Committer(engine)
    for commit in range(4):
        writes = [run_write(1 + commit * 5 + place, [b"x" * 1500]) for place in range(5)]
        committer.commit(writes, now_ns=commit)
    work = compaction(engine, objects)
    assert [work.compact(work.due(everything=True)[0]) for _ in range(4)] == [5, 5, 5, 5]


def test_a_batch_that_cannot_be_packed_stops_no_other(
    engine: StoreEngine, objects: ObjectStore, caplog: pytest.LogCaptureFixture
) -> None:
    """A mistake of ours, or a damaged row: it stays as it came, and is said once."""
    committer = Committer(engine)
    for seq in range(1, 10):
        committer.commit([run_write(seq, [b"%d" % seq])], now_ns=1)
    with engine.transaction(write=True):
        engine.execute("UPDATE sample_batches SET lengths = ? WHERE first_seq = 5", b"\x09\0\0\0")
    work = compaction(engine, objects)
    assert compact_all(work) == 8
    assert "stays as it came" in caplog.text
    caplog.clear()
    assert compact_all(work) == 0
    assert caplog.text == ""
    assert set(content(engine, loader=RunLoader(objects))[0]) == set(range(1, 10))
    assert compact_all(compaction(engine, objects)) == 0  # another process finds out by itself


def test_a_segment_is_an_mcap_file_of_one_robot(engine: StoreEngine, objects: ObjectStore) -> None:
    expected = fill(engine)
    topics = stored_topics(engine, "r1")
    channels = stored_channels(engine, "r1", most=99)
    assert [item.topic for item in channels] == sorted({item.topic for item in topics})
    assert [item.topic for item in stored_channels(engine, "r1", most=1)] == [topics[0].topic]
    compact_all(compaction(engine, objects))
    assert stored_topics(engine, "r1") == topics
    assert stored_channels(engine, "r1", most=99) == channels
    found: dict[int, bytes] = {}
    for name in names(objects):
        reader = make_reader(io.BytesIO(objects.read(name)), validate_crcs=True)
        for schema, channel, message in reader.iter_messages(topics=["/events"]):
            assert schema is not None
            assert (schema.name, schema.data, channel.message_encoding) == (
                "std_msgs/msg/String",
                b"string data",
                "cdr",
            )
            assert channel.metadata["robot"] == "r1"
            assert channel.metadata["epoch"] == str(EPOCH)
            assert channel.metadata["class"] == "event"
            assert message.sequence not in found
            found[message.sequence] = message.data
            assert message.log_time == 1000 + message.sequence
    assert found == expected


def test_filters_are_answered_alike_from_batches_and_segments(engine: StoreEngine, objects: ObjectStore) -> None:
    fill(engine)
    filters = [
        SampleFilter(),
        SampleFilter(topic="/scan"),
        SampleFilter(topics=("/scan", "/nothing")),
        SampleFilter(topics=()),
        SampleFilter(stream_id=7, epoch=EPOCH, first_seq=30),
        SampleFilter(start_ns=1050, end_ns=1060),
    ]
    before = [flat(engine, objects, wanted) for wanted in filters]
    assert before[3] == []
    assert all(before[place] for place in (0, 1, 2, 4, 5))
    for _ in range(4):
        work = compaction(engine, objects)
        for due in work.due(everything=True)[:1]:
            work.compact(due)
        assert [flat(engine, objects, wanted) for wanted in filters] == before
    compact_all(compaction(engine, objects))
    assert [flat(engine, objects, wanted) for wanted in filters] == before


def flat(engine: StoreEngine, objects: ObjectStore, wanted: SampleFilter) -> list[tuple[int, int, int, bytes]]:
    """The messages, cut to the filter: a segment's run has neighbours that were in other batches."""
    return [
        (batch.stream_id, seq, stamp_ns, data)
        for batch in read_samples(engine, "r1", wanted, limit=10_000, loader=RunLoader(objects))
        for seq, stamp_ns, data in batch.samples()
        if seq >= wanted.first_seq
        and (wanted.start_ns is None or stamp_ns >= wanted.start_ns)
        and (wanted.end_ns is None or stamp_ns <= wanted.end_ns)
    ]
