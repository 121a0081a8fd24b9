"""An agent that starts on a disk without a byte, its reserve used up: the oldest samples that may go make room."""

from __future__ import annotations

import random  # noqa: TID251 - seeded
from contextlib import suppress

import pytest

from edge_agent.errors import DiskError, DiskFullError
from edge_agent.outbox import LOGS, run_steps, steps
from metaros.clock import ManualClock
from tests.support.robots.outbox_drain import check_ledger, deliver
from tests.support.simulation.sim_agent import CLASSES, LIMITS, Ledger, WatchedOutbox
from tests.support.simulation.sim_disk import Crash, SimDisk
from tests.support.simulation.sim_gateway import SimStore

EVENTS = range(1, 20)


class Robot:
    """An outbox that may be started again and again on one disk."""

    def __init__(self) -> None:
        self.disk, self.clock, self.ledger = SimDisk(random.Random(1)), ManualClock(), Ledger()
        self._rng = random.Random(2)
        self.start()

    def start(self) -> None:
        """A process begins."""
        self.outbox = WatchedOutbox(
            self.ledger,
            self.disk,
            self.clock,
            new_epoch=lambda: self._rng.getrandbits(64),
            writer=f"{self._rng.getrandbits(64):016x}",
            classes=CLASSES,
            reserve_bytes=4096,
            limits=LIMITS,
        )
        self.outbox.online = True

    def gather(self, stream: int, delivery: str, stamp: int) -> None:
        """A sample is accepted."""
        self.outbox.append(stream, delivery, stamp, (1, 0.5) if delivery == "metric" else bytes(900))
        for name in LOGS:
            run_steps(steps(self.outbox, self.disk, name))
        self.clock.advance(1.0)

    def fill(self) -> None:
        """No byte is left, and no reserve."""
        self.outbox.release_reserve()
        self.disk.foreign_bytes = 0
        self.disk.foreign_bytes = self.disk.free()[0]
        assert self.disk.free()[0] == 0


def full_robot() -> Robot:
    """One that holds events and many segments of bulk on a full disk."""
    robot = Robot()
    for stamp in EVENTS:
        robot.gather(1, "event", stamp)
    for stamp in range(100, 140):
        robot.gather(2, "bulk", stamp)
    assert len(robot.outbox.logs["bulk"].segments) > 3
    robot.fill()
    return robot


def test_it_starts_and_declares_what_had_to_go() -> None:
    robot = full_robot()
    before = len(robot.outbox.logs["bulk"].segments)
    robot.start()
    gone = [segment for segment in robot.outbox.logs["bulk"].segments if segment.header.rewritten == "dropped"]
    assert len(gone) == 1, "no more than it takes"
    assert len(robot.outbox.logs["bulk"].segments) == before
    store = SimStore()
    deliver(robot.outbox, store)
    check_ledger(robot.ledger, store)
    stamps = {stamp for rows in store.rows.values() for stamp in rows.values()}
    assert stamps >= set(EVENTS)
    lost = sum(map(len, store.gaps.values()))
    assert 0 < lost < 10
    assert robot.outbox.lost["bulk"] == lost
    assert len(stamps) + lost == len(robot.ledger.places)


def interrupted_start(*, crash_in: int | None = None, fail_in: int | None = None) -> SimStore:
    """What reaches the store of a robot whose first start is interrupted, and whose second one is not."""
    robot = full_robot()
    robot.disk.crash_in, robot.disk.fail_in = crash_in, fail_in
    with suppress(DiskError if crash_in is None else Crash):
        robot.start()
    robot.disk.crash_in = robot.disk.fail_in = None
    robot.start()
    store = SimStore()
    deliver(robot.outbox, store)
    check_ledger(robot.ledger, store)
    return store


@pytest.mark.parametrize("point", range(8))
def test_a_crash_on_the_way_loses_nothing_undeclared(point: int) -> None:
    store = interrupted_start(crash_in=point)
    assert {stamp for rows in store.rows.values() for stamp in rows.values()} >= set(EVENTS)


@pytest.mark.parametrize("point", range(4))
def test_a_disk_that_fails_on_the_way_is_tried_again(point: int) -> None:
    store = interrupted_start(fail_in=point)
    assert {stamp for rows in store.rows.values() for stamp in rows.values()} >= set(EVENTS)


def test_where_nothing_may_go_it_says_so_and_changes_nothing() -> None:
    robot = Robot()
    for stamp in EVENTS:
        robot.gather(1, "event", stamp)
    robot.fill()
    files = dict(robot.disk.files)
    with pytest.raises(DiskFullError):
        robot.start()
    assert robot.disk.files == files


def test_a_disk_with_its_reserve_gives_that_and_no_sample() -> None:
    robot = full_robot()
    robot.disk.foreign_bytes = 0
    robot.outbox.restore_reserve()
    robot.disk.foreign_bytes = robot.disk.free()[0]
    robot.start()
    assert not any(segment.header.rewritten for segment in robot.outbox.logs["bulk"].segments)
    assert robot.disk.size("reserve") == 0
