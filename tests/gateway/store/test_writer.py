"""The writer outlives whatever a commit, a job or its housekeeping does, and says so once."""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence
from concurrent.futures import wait
from pathlib import Path
from typing import Any

import pytest

from gateway.errors import StoreError
from gateway.store.commit import Committer
from gateway.store.engine import StoreEngine
from gateway.store.retention import Retention
from gateway.store.sqlite import SqliteEngine
from gateway.store.telemetry.merge import waiting_batches
from gateway.store.telemetry.query import read_streams
from gateway.store.writer import Pace, Writer
from gateway.store.writes import Committed, StreamWrite, Write
from metaros.clock import SystemClock
from tests.gateway.store.samples import CPU, EPOCH, everything, run_write, write
from tests.support.waiting import wait_until

WAIT_S = 60


class Rig:
    """A writer on SQLite, and what it told."""

    def __init__(self, folder: Path, **pace: Any) -> None:
        self.engine = SqliteEngine(folder)
        self.engine.open()
        self.folder = folder
        self.refused: list[Write] = []
        self.marks: dict[str, int] = {}
        self.writer = Writer(
            self.engine,
            clock=SystemClock(),
            on_commit=self._on_commit,
            on_refused=self.refused.extend,
            retention=Retention(age_s=1e9, size_bytes=1 << 40),
            pace=Pace(retry_every_s=0.001, **pace),
        )

    def _on_commit(self, done: Committed) -> None:
        self.marks.update((mark.robot, mark.seq) for mark in done.marks)

    def stored(self, robot: str) -> dict[tuple[int, int], int]:
        """The robot's watermarks, read on a connection of its own."""
        reader = self.engine.reader()
        try:
            return read_streams(reader, robot)
        finally:
            reader.close()


class Odd(StreamWrite):
    """A write that breaks the commit in a way that nobody foresaw."""

    def after(self, watermark: int) -> StreamWrite | None:
        """Raises."""
        raise ZeroDivisionError("a mistake of ours")


def odd(robot: str) -> Odd:
    return Odd(robot=robot, stream_id=7, epoch=EPOCH, seq=1)


def test_one_robots_write_that_breaks_the_commit_is_refused(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    rig = Rig(tmp_path)
    for robot in ("good", "odd", "fine"):
        rig.writer.submit(odd("odd") if robot == "odd" else run_write(1, [b"x"], robot=robot))
    rig.writer.start()
    rig.writer.flush().result(WAIT_S)
    assert rig.marks == {"good": 1, "fine": 1}
    assert {write.robot for write in rig.refused if isinstance(write, StreamWrite)} == {"odd"}
    rig.writer.submit(run_write(1, [b"x"], robot="odd"))
    rig.writer.flush().result(WAIT_S)
    assert rig.marks["odd"] == 1
    assert rig.writer.error is None
    rig.writer.close(timeout_s=WAIT_S)
    assert sum("nobody foresaw" in record.message for record in caplog.records) >= 1


@pytest.mark.parametrize("error", [MemoryError("no memory"), StoreError("the disk is full")])
def test_commits_that_all_break_are_a_failed_commit(
    tmp_path: Path, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    """Every robot is told to send again, nothing is acknowledged, and afterwards all is stored."""
    caplog.set_level(logging.ERROR)
    rig = Rig(tmp_path)
    whole = Committer.commit
    broken = True

    def commit(self: Committer, writes: Sequence[Write], *, now_ns: int) -> Committed:
        if broken:
            raise error
        return whole(self, writes, now_ns=now_ns)

    monkeypatch.setattr(Committer, "commit", commit)
    rig.writer.submit(run_write(1, [b"x"], robot="one"))
    rig.writer.submit(run_write(1, [b"x"], robot="two"))
    job = rig.writer.run(lambda engine: "ran")
    rig.writer.start()
    if isinstance(error, StoreError):  # of the disk, not of what the robots sent
        with pytest.raises(StoreError, match=r"^the store cannot commit: the disk is full"):
            job.result(WAIT_S)
    else:
        assert job.result(WAIT_S) == "ran"
    wait_until(lambda: {getattr(write, "robot", "") for write in rig.refused} == {"one", "two"})
    assert rig.marks == {}
    broken = False
    for robot in ("one", "two"):
        rig.writer.submit(run_write(1, [b"x"], robot=robot))
    wait_until(lambda: rig.marks == {"one": 1, "two": 1})
    assert rig.writer.error is None
    rig.writer.close(timeout_s=WAIT_S)


def test_a_job_runs_between_commits_all_or_nothing(tmp_path: Path) -> None:
    rig = Rig(tmp_path)

    def note(engine: StoreEngine, text: str) -> str:
        engine.execute("INSERT INTO meta VALUES (?, 'x')", text)
        return text

    def fail(engine: StoreEngine) -> None:
        note(engine, "undone")
        raise KeyError("no")

    rig.writer.submit(run_write(1, [b"x"]))
    seen = rig.writer.run(lambda engine: engine.fetch("SELECT count(*) FROM sample_batches")[0][0])
    failed, done = rig.writer.run(fail), rig.writer.run(lambda engine: note(engine, "done"))
    rig.writer.submit(run_write(2, [b"x"]))
    rig.writer.start()
    assert seen.result(WAIT_S) == 1  # what was submitted before is committed before, and nothing else
    assert done.result(WAIT_S) == "done"
    with pytest.raises(KeyError):
        failed.result(WAIT_S)
    reader = rig.engine.reader()
    with reader.transaction(write=False):
        assert [row[0] for row in reader.fetch("SELECT key FROM meta WHERE value = 'x'")] == ["done"]
    reader.close()
    rig.writer.close(timeout_s=WAIT_S)
    with pytest.raises(StoreError, match="closing"):
        rig.writer.run(lambda engine: None).result(WAIT_S)


def test_jobs_and_writes_at_the_end(tmp_path: Path) -> None:
    """Everything that was queued before the end is done, in order; what is cancelled harms nobody."""
    rig = Rig(tmp_path)
    jobs = []
    for seq in range(1, 30):
        rig.writer.submit(run_write(seq, [b"x"]))
        jobs.append(rig.writer.run(lambda engine: engine.fetch("SELECT count(*) FROM sample_batches")[0][0]))
    jobs.pop(5).cancel()
    rig.writer.start()
    rig.writer.close(timeout_s=WAIT_S)
    wait(jobs, WAIT_S)
    assert [job.result() for job in jobs] == [*range(1, 6), *range(7, 30)]
    assert rig.stored("r1") == {(7, EPOCH): 29}


def test_housekeeping_that_breaks_ends_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    calls: Collection[int] = []

    def broken(*args: object, **options: object) -> tuple[int, int]:
        assert isinstance(calls, list)
        calls.append(1)
        raise RuntimeError("the merge has a mistake")

    monkeypatch.setattr("gateway.store.writer.waiting_batches", broken)
    rig = Rig(tmp_path, merge_look_every_s=0.0, merge_after_s=0.0)
    rig.writer.start()
    wait_until(lambda: calls)
    for seq in range(1, 6):
        rig.writer.submit(run_write(seq, [b"x"]))
        rig.writer.flush().result(WAIT_S)
    assert rig.marks == {"r1": 5}
    rig.writer.close(timeout_s=WAIT_S)


def test_a_listener_that_breaks_ends_nothing(tmp_path: Path) -> None:
    rig = Rig(tmp_path)
    broken = [True]

    def on_commit(done: Committed) -> None:
        if broken.pop():
            raise RuntimeError("the listener has a mistake")

    rig.writer._on_commit = on_commit
    rig.writer.start()
    rig.writer.submit(run_write(1, [b"x"]))
    wait_until(lambda: not broken)
    broken.append(False)
    rig.writer.submit(run_write(2, [b"x"]))
    wait_until(lambda: not broken)
    assert rig.stored("r1") == {(7, EPOCH): 2}
    rig.writer.close(timeout_s=WAIT_S)


def test_rows_are_merged_beside_the_commits(tmp_path: Path) -> None:
    rig = Rig(tmp_path, merge_at_batches=2, merge_look_every_s=0.0, merge_step_batches=2, commit_every_s=0.0)
    rig.writer.start()
    reader = rig.engine.reader()
    for first in range(0, 2000, 100):
        rig.writer.submit(write(first + 100, *[(CPU, first + i, float(i)) for i in range(100)]))
        rig.writer.flush().result(WAIT_S)
    wait_until(lambda: waiting_batches(reader)[0] < 2, timeout_s=WAIT_S)
    assert everything(reader, "host.cpu") == [(float(n), float(n % 100)) for n in range(2000)]
    reader.close()
    rig.writer.close()
