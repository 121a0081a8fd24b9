"""The contract in the commit: what follows the watermark is stored once, whatever comes, in any order."""

from __future__ import annotations

import contextlib
import random  # noqa: TID251 - seeded
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.domain.sample import Gap
from gateway.errors import StoreError
from gateway.ingest.events import Arrived, GapDeclared
from gateway.store import Mark, StreamWrite, WriterWrite
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.postgres import PostgresEngine
from gateway.store.sqlite import SqliteEngine
from gateway.store.telemetry.query import read_gaps, read_series, read_streams, read_writers
from tests.gateway.store.samples import BATTERY, CPU, EPOCH, content, everything, gap_write, run_write, write
from tests.support.servers.postgres import PostgresServer
from tests.support.servers.sqlite_store import place_store
from tests.support.simulation.sim_gateway import SimStore


def test_rows_watermark_and_gap_move_together(engine: StoreEngine) -> None:
    gap = Gap(3, 9, "outbox_full", 1, 2)
    done = Committer(engine).commit([write(2, (CPU, 1, 0.5), (BATTERY, 2, 0.7)), write(9, gap=gap)], now_ns=5)
    assert done.marks == [Mark("r1", 0, EPOCH, 9)]
    assert read_streams(engine, "r1") == {(0, EPOCH): 9}
    assert [stored.gap for stored in read_gaps(engine, "r1", limit=9)] == [gap]
    assert everything(engine, "host.cpu") == [(1.0, 0.5)]
    facts = {item.series.name: (item.samples, item.stamp_ns, item.value) for item in read_series(engine, "r1")}
    assert facts == {"battery": (1, 2, 0.7), "host.cpu": (1, 1, 0.5)}


def test_what_does_not_follow_is_dropped(engine: StoreEngine) -> None:
    committer = Committer(engine)
    assert committer.commit([run_write(3, [b"c"])], now_ns=1).marks == []  # 1 and 2 were refused
    assert content(engine) == ({}, set())
    done = committer.commit([run_write(1, [b"a", b"b"]), run_write(4, [b"d"]), gap_write(4, 9)], now_ns=1)
    assert done.marks == [Mark("r1", 7, EPOCH, 2)]
    assert content(engine) == ({1: b"a", 2: b"b"}, set())


def test_what_was_stored_is_dropped_and_acknowledged_again(engine: StoreEngine) -> None:
    committer = Committer(engine)
    committer.commit([run_write(1, [b"a", b"b"])], now_ns=1)
    again = [run_write(1, [b"x", b"y"]), gap_write(1, 2), StreamWrite(robot="r1", stream_id=7, epoch=EPOCH, seq=9)]
    assert committer.commit(again, now_ns=2).marks == [Mark("r1", 7, EPOCH, 2)]
    assert content(engine) == ({1: b"a", 2: b"b"}, set())


def test_an_overlap_is_trimmed(engine: StoreEngine) -> None:
    committer = Committer(engine)
    committer.commit([run_write(1, [b"a", b"bb"]), write(2, (CPU, 1, 1.0), (CPU, 2, 2.0))], now_ns=1)
    rows = write(4, (BATTERY, 1, -1.0), (CPU, 2, -1.0), (CPU, 3, 3.0), (BATTERY, 4, 4.0))
    done = committer.commit([run_write(1, [b"x", b"yy", b"ccc", b"d"]), gap_write(2, 6), rows], now_ns=2)
    assert sorted(done.marks) == [Mark("r1", 0, EPOCH, 4), Mark("r1", 7, EPOCH, 6)]
    assert content(engine) == ({1: b"a", 2: b"bb", 3: b"ccc", 4: b"d"}, {5, 6})
    assert everything(engine, "host.cpu") == [(1.0, 1.0), (2.0, 2.0), (3.0, 3.0)]
    assert everything(engine, "battery") == [(4.0, 4.0)]


def test_a_stream_may_begin_later(engine: StoreEngine) -> None:
    committer = Committer(engine)
    assert committer.commit([run_write(8, [b"h"], base=5)], now_ns=1).marks == []
    assert committer.commit([run_write(5, [b"e", b"f"], base=5)], now_ns=1).marks == [Mark("r1", 7, EPOCH, 6)]
    assert content(engine) == ({6: b"f"}, set())
    assert committer.commit([run_write(7, [b"g"], base=0)], now_ns=1).marks == [Mark("r1", 7, EPOCH, 7)]


def test_many_robots_streams_and_epochs_in_one_commit(connect: Callable[[], StoreEngine]) -> None:
    committer = Committer(connect())
    writes = [
        run_write(1, [b"1"] * 3, robot=f"r{robot}", stream_id=stream, epoch=epoch)
        for robot in range(30)
        for stream in range(1, 12)
        for epoch in (1, 2**64 - 1)
    ]
    for commit in (writes, writes):
        assert {tuple(mark) for mark in committer.commit(commit, now_ns=1).marks} == {
            (write.robot, write.stream_id, write.epoch, 3) for write in writes
        }
    fresh = Committer(connect())  # a new process, which remembers nothing
    assert len(fresh.commit(writes, now_ns=1).marks) == len(writes)
    assert read_streams(connect(), "r29") == {(s, e): 3 for s in range(1, 12) for e in (1, 2**64 - 1)}


def test_the_last_writer_of_an_epoch_is_kept(engine: StoreEngine) -> None:
    named = [("r1", 5, "a"), ("r1", 2**64 - 1, "b"), ("r1", 5, "c"), ("r2", 5, "d")]
    writes = [WriterWrite(robot=robot, epoch=epoch, writer=writer) for robot, epoch, writer in named]
    Committer(engine).commit(writes, now_ns=1)
    assert read_writers(engine, "r1") == {5: "c", 2**64 - 1: "b"}


def test_a_failed_commit_leaves_nothing_and_can_be_repeated(tmp_path: Path) -> None:
    engine = SqliteEngine(tmp_path)
    engine.open()
    committer = Committer(engine)
    pages = engine.connection.execute("PRAGMA page_count").fetchone()[0]
    engine.connection.execute(f"PRAGMA max_page_count = {pages + 2}")
    many = [write(n * 1000, *[(CPU, n * 1000 + i, 1.0) for i in range(1000)]) for n in range(1, 20)]
    with pytest.raises(StoreError, match="full"):
        committer.commit(many, now_ns=1)
    assert read_streams(engine, "r1") == {}
    engine.connection.execute("PRAGMA max_page_count = 1000000")
    committer.commit(many, now_ns=1)
    assert read_streams(engine, "r1") == {(0, EPOCH): 19_000}
    assert read_series(engine, "r1")[0].samples == 19_000
    engine.close()


class BreakingEngine(SqliteEngine):
    """A database whose connection breaks at the end of a transaction: `before` it happened, or `after`."""

    breaks = ""

    @contextlib.contextmanager
    def transaction(self, *, write: bool) -> Iterator[None]:
        with super().transaction(write=write):
            yield
            if write and self.breaks == "before":
                raise StoreError("the connection broke")
        if write and self.breaks == "after":
            raise StoreError("the connection broke, and nobody knows")


Item = tuple[str, int, int, int]
ITEMS = st.tuples(st.sampled_from(("run", "gap", "touch")), st.integers(1, 2), st.integers(1, 30), st.integers(1, 6))
FATES = st.sampled_from(("", "", "before", "after", "restart"))


def made(item: Item, stamp_ns: int) -> tuple[StreamWrite, object | None]:
    """A write, and the event that the simulator's store would get for it."""
    kind, stream_id, first_seq, count = item
    base = 4 * (stream_id == 2)
    if kind == "gap":
        gap = gap_write(first_seq, first_seq + count - 1, stream_id=stream_id, base=base)
        assert gap.gap is not None
        return gap, GapDeclared(stream_id, EPOCH, gap.gap)
    if kind == "run":
        payloads = [b"%d" % (stamp_ns + seq) for seq in range(first_seq, first_seq + count)]
        run = run_write(first_seq, payloads, stream_id=stream_id, base=base, stamp_ns=stamp_ns)
        assert run.run is not None
        return run, Arrived(run.run, EPOCH, run.seq, True, 0)
    return StreamWrite(robot="r1", stream_id=stream_id, epoch=EPOCH, seq=first_seq, base=base), None


@given(st.lists(st.tuples(st.lists(ITEMS, max_size=8), FATES), max_size=8))
@settings(max_examples=50)
def test_every_commit_agrees_with_the_rule(commits: list[tuple[list[Item], str]]) -> None:
    """Against the simulator's store, which is the rule in a few lines."""
    with tempfile.TemporaryDirectory() as folder:
        engine = BreakingEngine(place_store(Path(folder)))
        engine.connection.execute("PRAGMA synchronous = OFF")
        engine.open()
        committer, rule = Committer(engine), SimStore(bases={(2, EPOCH): 4})
        for number, (items, fate) in enumerate(commits, 1):
            pairs = [made(item, number * 10_000 + place * 100) for place, item in enumerate(items)]
            writes, events = [pair[0] for pair in pairs], [pair[1] for pair in pairs if pair[1] is not None]
            engine.breaks = fate
            if fate in ("before", "after"):
                with pytest.raises(StoreError):
                    committer.commit(writes, now_ns=1)
                if fate == "after":
                    rule.commit(events)
                engine.breaks = ""
            if fate == "restart":
                committer = Committer(engine)
            marks = committer.commit(writes, now_ns=1).marks
            rule.commit(events)
            touched = {(write_.stream_id, write_.epoch) for write_ in writes}
            assert {tuple(mark)[1:] for mark in marks} == {(*k, rule.marks[k]) for k in touched if k in rule.marks}
            agree(engine, rule)
        engine.close()


def agree(engine: StoreEngine, rule: SimStore) -> None:
    """Both stores hold the same."""
    assert read_streams(engine, "r1") == rule.marks
    for stream_id in (1, 2):
        found, lost = content(engine, stream_id=stream_id)
        assert {seq: int(payload) for seq, payload in found.items()} == rule.rows.get((stream_id, EPOCH), {})
        assert lost == rule.gaps.get((stream_id, EPOCH), set())


def test_on_postgresql_too(postgres: PostgresServer) -> None:
    """The same with a fixed seed; every commit is repeated, as one of which nobody knows how it ended."""
    url = postgres.schema()
    engine = PostgresEngine(url)
    engine.open()
    committer, rule, rng = Committer(engine), SimStore(bases={(2, EPOCH): 4}), random.Random(5)
    for number in range(1, 60):
        items: list[Item] = []
        for _ in range(rng.randrange(9)):
            kind = rng.choice(("run", "gap", "touch"))
            items.append((kind, rng.choice((1, 2)), rng.randrange(1, 2 * number + 6), rng.randrange(1, 7)))
        pairs = [made(item, number * 10_000 + place * 100) for place, item in enumerate(items)]
        committer.commit([pair[0] for pair in pairs], now_ns=1)
        committer = Committer(engine) if rng.choice((0, 0, 1)) else committer
        committer.commit([pair[0] for pair in pairs], now_ns=1)
        rule.commit([pair[1] for pair in pairs if pair[1] is not None])
        rule.commit([pair[1] for pair in pairs if pair[1] is not None])
        agree(engine, rule)
    engine.close()
