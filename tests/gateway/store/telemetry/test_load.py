"""Reading runs back: damage is named and stays where it is, the newest sample at an instant, bounded memory."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gateway.errors import CorruptObjectError, DamagedError, ObjectMissingError
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.ledger import in_transaction
from gateway.store.objects import DirectoryStore
from gateway.store.telemetry.compact import Compaction, CompactPace
from gateway.store.telemetry.history import find_runs, gaps_between, newest_candidates
from gateway.store.telemetry.load import RunLoader
from gateway.store.telemetry.samples import SampleFilter, StoredRun
from metaros.clock import ManualClock
from tests.gateway.store.samples import gap_write, run_write


@pytest.fixture
def objects(tmp_path: Path) -> DirectoryStore:
    """An empty object store."""
    return DirectoryStore(tmp_path / "objects")


def compact(engine: StoreEngine, objects: DirectoryStore, *, size_bytes: int = 1) -> int:
    """One segment a batch, or of that many bytes."""
    pace = CompactPace(size_bytes=size_bytes)
    work = Compaction(engine, in_transaction(engine), objects, clock=ManualClock(), pace=pace)
    return sum(work.compact(due) for due in work.due(everything=True))


def segment_files(tmp_path: Path) -> list[Path]:
    return sorted((tmp_path / "objects").rglob("*.mcap"))


def test_damage_is_named_and_the_rest_is_read(engine: StoreEngine, objects: DirectoryStore, tmp_path: Path) -> None:
    committer = Committer(engine)
    for number in range(1, 4):
        committer.commit([run_write(number, [b"%d" % number * 100])], now_ns=number)
        assert compact(engine, objects) == 1
    first, second, third = find_runs(engine, "r1", SampleFilter(), limit=9)
    files = segment_files(tmp_path)
    files[0].write_bytes(files[0].read_bytes().replace(b"ros2", b"ros3"))  # the head, which no run lies in
    damaged = bytearray(files[1].read_bytes())
    assert second.place is not None
    damaged[second.place.chunk_start + second.place.chunk_bytes // 2] ^= 0xFF
    files[1].write_bytes(damaged)
    files[2].unlink()
    loader = RunLoader(objects)
    assert loader.load(engine, first).payload == b"1" * 100
    with pytest.raises(CorruptObjectError, match="segments/"):
        loader.load(engine, second)
    with pytest.raises(ObjectMissingError):
        loader.load(engine, third)
    files[1].write_bytes(damaged[:50])
    with pytest.raises(CorruptObjectError):
        RunLoader(objects).load(engine, second)
    with pytest.raises(DamagedError):
        RunLoader(None).load(engine, first)


def test_chunks_are_read_once_and_the_cache_is_bounded(engine: StoreEngine, objects: DirectoryStore) -> None:
    class Counting(DirectoryStore):
        reads = 0

        def read(self, name: str, *, start: int = 0, size_bytes: int | None = None) -> bytes:
            self.reads += 1
            return super().read(name, start=start, size_bytes=size_bytes)

    counting = Counting(objects._root)
    committer = Committer(engine)
    for number in range(1, 7):
        committer.commit([run_write(number, [b"x" * 10_000])], now_ns=number)
        compact(engine, objects)
    runs = find_runs(engine, "r1", SampleFilter(), limit=9)
    loader = RunLoader(counting, cache_bytes=35_000)
    for run in [*runs[:3], *runs[:3]]:
        assert loader.load(engine, run).payload == b"x" * 10_000
    assert counting.reads == 3
    for run in [*runs, *runs]:
        loader.load(engine, run)
    assert counting.reads > 9
    assert loader._cache._size_bytes <= 35_000
    kept, size_bytes = dict(loader._cache._chunks), loader._cache._size_bytes
    for key in kept:
        loader._cache.put(key, b"read twice at once")
    assert (dict(loader._cache._chunks), loader._cache._size_bytes) == (kept, size_bytes)
    whole = loader.load(engine, runs[0])
    assert whole.cut(1, 1) is whole
    small = RunLoader(counting, cache_bytes=10)
    small.load(engine, runs[0])
    assert small._cache._size_bytes == 0


def test_a_large_sample_lies_in_a_chunk_of_its_own(engine: StoreEngine, objects: DirectoryStore) -> None:
    committer, big = Committer(engine), bytes(range(256)) * 65_536
    committer.commit([run_write(1, [b"small"]), run_write(2, [big]), run_write(3, [b"after"])], now_ns=1)
    assert compact(engine, objects, size_bytes=1 << 30) == 3
    runs = find_runs(engine, "r1", SampleFilter(), limit=9)
    assert [(run.first_seq, run.count) for run in runs] == [(1, 1), (2, 1), (3, 1)]
    assert len({run.place.chunk_start for run in runs if run.place is not None}) == 3
    assert RunLoader(objects).load(engine, runs[1]).payload == big


Batch = tuple[int, int, int]  # first stamp, step, count; the clock of a robot may be set back
BATCHES = st.lists(st.tuples(st.integers(0, 60), st.integers(-3, 5), st.integers(1, 5)), min_size=1, max_size=8)


@given(batches=BATCHES, compacted=st.integers(0, 8), max_age=st.one_of(st.none(), st.integers(0, 40)))
@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_the_newest_at_an_instant(
    engine: StoreEngine, objects: DirectoryStore, batches: list[Batch], compacted: int, max_age: int | None
) -> None:
    robot = f"r{len(find_robots(engine)) + 1}"
    committer, stamps, seq = Committer(engine), [], 1
    for number, (first_ns, step, count) in enumerate(batches):
        write = run_write(seq, [b"m"] * count, robot=robot)
        assert write.run is not None
        write.run.columns.stamps_ns[:] = [max(0, first_ns + step * place) for place in range(count)]
        stamps += write.run.columns.stamps_ns.tolist()
        committer.commit([write], now_ns=1)
        seq += count
        if number == compacted:
            compact(engine, objects, size_bytes=1 << 20)
    loader = RunLoader(objects)
    for t_ns in range(-1, 90, 7):
        found = loader.newest(engine, newest_candidates(engine, robot, "/events", t_ns), t_ns, max_age_ns=max_age)
        want = max((stamp for stamp in stamps if stamp <= t_ns), default=None)
        if want is None or (max_age is not None and want < t_ns - max_age):
            assert found is None
        else:
            assert newest_in(engine, loader, found, t_ns) == want


def newest_in(engine: StoreEngine, loader: RunLoader, run: StoredRun | None, t_ns: int) -> int:
    assert run is not None
    stamps = loader.load(engine, run).stamps_ns
    return int(stamps[stamps <= t_ns].max())


def find_robots(engine: StoreEngine) -> list[str]:
    with engine.transaction(write=False):
        return [row[0] for row in engine.fetch("SELECT id FROM robots")]


def test_runs_page_by_key_in_both_orders(engine: StoreEngine, objects: DirectoryStore) -> None:
    committer = Committer(engine)
    for number in range(1, 21):
        stream_id = 7 + number % 2
        writes = [run_write((number + 1) // 2, [b"x"], stream_id=stream_id, stamp_ns=100 * (number % 5))]
        committer.commit(writes, now_ns=number)
        if number == 10:
            compact(engine, objects, size_bytes=3)
    for newest_first in (False, True):
        whole = find_runs(engine, "r1", SampleFilter(), limit=99, newest_first=newest_first)
        assert len(whole) > 10
        keys = [run.key(newest_first=newest_first) for run in whole]
        pages, after = [], None
        while page := find_runs(engine, "r1", SampleFilter(after=after), limit=3, newest_first=newest_first):
            pages += page
            after = page[-1].key(newest_first=newest_first)
        assert [run.key(newest_first=newest_first) for run in pages] == keys
        assert [key[0] for key in keys] == sorted((key[0] for key in keys), reverse=newest_first)


def test_losses_between_two_stamps_know_their_topic(engine: StoreEngine, objects: DirectoryStore) -> None:
    Committer(engine).commit([run_write(1, [b"a"]), gap_write(2, 5), gap_write(1, 9, stream_id=0)], now_ns=1)
    for _ in range(2):
        found = gaps_between(engine, "r1", start_ns=2, end_ns=50, limit=9)
        assert {(item.stream_id, item.gap.from_seq, item.gap.to_seq, item.topic, item.delivery) for item in found} == {
            (7, 2, 5, "/events", "event"),
            (0, 1, 9, "", ""),
        }
        compact(engine, objects)
    assert gaps_between(engine, "r1", start_ns=3, end_ns=50, limit=9) == []
    assert gaps_between(engine, "r1", start_ns=0, end_ns=0, limit=9) == []
    assert len(gaps_between(engine, "r1", start_ns=0, end_ns=9, limit=1)) == 1
    assert gaps_between(engine, "nobody", start_ns=0, end_ns=9, limit=1) == []
