"""A short life of the outbox on the real file system, with system calls failing at each place, in five ways."""

from __future__ import annotations

import contextlib
import random  # noqa: TID251 - seeded
import shutil
from collections.abc import Iterator
from pathlib import Path
from tempfile import mkdtemp

import pytest

from edge_agent.errors import DiskError
from edge_agent.outbox import LOGS, Disk, OsDisk, run_steps, steps
from metaros.clock import ManualClock
from tests.support.robots.counting_calls import FAULTS, CountingCalls, PowerCutError, points
from tests.support.robots.outbox_drain import check_ledger, deliver
from tests.support.simulation.sim_agent import CLASSES, LIMITS, Ledger, WatchedOutbox
from tests.support.simulation.sim_gateway import SimStore

MEMORY = Path("/dev/shm")  # a file system on which a sync costs nothing, where there is one


@pytest.fixture
def folder(tmp_path: Path) -> Iterator[Path]:
    """A directory on the fastest file system there is."""
    path = Path(mkdtemp(dir=MEMORY)) if MEMORY.is_dir() else tmp_path
    yield path
    shutil.rmtree(path)


class Life:
    """What happens to one directory: appends of all classes, rolls, thinning, drops, acknowledgements, restarts."""

    def __init__(self) -> None:
        self.ledger, self.store, self.clock = Ledger(), SimStore(), ManualClock()
        self._rng = random.Random(1)
        self._stamp = 0

    def open(self, disk: Disk) -> WatchedOutbox:
        """A process begins; it tries again where the disk failed."""
        for last in (False, True):
            try:
                return WatchedOutbox(
                    self.ledger,
                    disk,
                    self.clock,
                    new_epoch=lambda: self._rng.getrandbits(64),
                    writer=f"{self._rng.getrandbits(64):016x}",
                    classes=CLASSES,
                    reserve_bytes=8192,
                    limits=LIMITS,
                )
            except DiskError:
                if last:
                    raise
        raise AssertionError

    def run(self, disk: Disk) -> None:
        """All of it."""
        outbox = self.open(disk)
        outbox.online = True
        self.gather(outbox, disk, sizes=(40, 3000), metrics=10)
        deliver(outbox, self.store, most=4)
        outbox.online = False
        for _ in range(5):
            self.gather(outbox, disk, sizes=(4000, 4000, 4000), metrics=60)
        outbox = self.open(disk)
        outbox.online = True
        self.gather(outbox, disk, sizes=(40, 4000), metrics=5)
        deliver(outbox, self.store)
        self.gather(outbox, disk, sizes=(40,), metrics=5)

    def gather(self, outbox: WatchedOutbox, disk: Disk, *, sizes: tuple[int, ...], metrics: int) -> None:
        """Samples come, and are flushed."""
        for size in sizes:
            for stream, delivery in ((1, "event"), (2, "bulk"), (3, "bulk")):
                self._stamp += 1
                outbox.append(stream, delivery, self._stamp, bytes(min(size, 300) if delivery == "event" else size))
        for _ in range(metrics):
            self._stamp += 1
            outbox.append(0, "metric", self._stamp, (1, 0.5))
        for name in LOGS:
            run_steps(steps(outbox, disk, name))
            self.clock.advance(1.0)

    def end(self, disk: Disk) -> None:
        """A process on a disk that works: everything arrives."""
        outbox = self.open(disk)
        for _ in range(2):
            deliver(outbox, self.store)
        assert not any(outbox.depth(name).samples for name in CLASSES)
        check_ledger(self.ledger, self.store)


def test_the_life_is_a_full_one(folder: Path) -> None:
    """It rolls, thins out and drops, or the test below would say little."""
    calls, life = CountingCalls(), Life()
    life.run(OsDisk(folder / "outbox", calls=calls))
    life.end(OsDisk(folder / "outbox"))
    assert 100 < calls.count < 2000
    gaps = {stream for (stream, _), gaps in life.store.gaps.items() if gaps}
    assert {stream & 0xFF for stream in gaps} >= {0, 2, 3}
    assert len(life.ledger.places) > 300


@pytest.mark.integration
@pytest.mark.parametrize("fault", FAULTS)
def test_a_call_fails_at_each_place(folder: Path, fault: str) -> None:
    whole = CountingCalls()
    Life().run(OsDisk(folder / "whole", calls=whole))
    assert set(whole.names) >= {"open", "write", "fdatasync", "fsync", "ftruncate", "replace", "unlink"}
    for fail_at in points(whole, fault):
        root, calls, life = folder / str(fail_at), CountingCalls(fail_at=fail_at, fault=fault), Life()
        with contextlib.suppress(PowerCutError):
            life.run(OsDisk(root, calls=calls))
        assert calls.fired
        try:
            life.end(OsDisk(root))
        except AssertionError as error:
            raise AssertionError(f"{fault} at call {fail_at}, {calls.name}: {error}") from error
        shutil.rmtree(root)
