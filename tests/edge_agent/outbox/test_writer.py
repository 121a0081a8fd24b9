"""The task and the thread that flush the outbox: when, and what is left at the end."""

from __future__ import annotations

import asyncio
import random  # noqa: TID251 - seeded
import threading

import pytest

from edge_agent.errors import DiskError
from edge_agent.outbox import Kind, Outbox, OutboxWriter
from metaros.clock import Clock, ManualClock, SystemClock
from tests.edge_agent.parts import accept, make_outbox, policies, taken
from tests.support.processes.threads import left_behind, threads_now
from tests.support.simulation.sim_disk import SimDisk
from tests.support.waiting import wait_until_async


class SlowDisk(SimDisk):
    """Appends wait until they are let go."""

    def __init__(self) -> None:
        super().__init__(random.Random(1))
        self.go = threading.Event()
        self.go.set()
        self.inside = 0

    def append(self, name: str, offset: int, data: bytes) -> None:
        self.inside += 1
        assert self.go.wait(60)
        super().append(name, offset, data)


def held(disk: SimDisk, clock: Clock | None = None) -> dict[int, int]:
    """Stream -> newest number, as the next process finds it."""
    return {item.stream_id: item.last_seq for item in make_outbox(disk, clock, seed=9).ranges()}


def rig(disk: SimDisk) -> tuple[Outbox, OutboxWriter, list[int]]:
    outbox = make_outbox(disk, SystemClock())
    outbox.online = True
    flushed: list[int] = []
    return outbox, OutboxWriter(outbox, disk, on_flushed=lambda: flushed.append(1)), flushed


async def test_it_flushes_what_is_gathered_and_says_so() -> None:
    before = threads_now()
    outbox, writer, flushed = rig(SlowDisk())
    task = asyncio.create_task(writer.run())
    outbox.append(1, "bulk", 5, b"x")
    writer.wake()
    await wait_until_async(lambda: outbox.depth("bulk").samples == 1)
    await wait_until_async(lambda: bool(flushed))
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    assert left_behind(before, "outbox-writer") == []


async def test_its_end_waits_for_the_job_under_way_and_flushes_what_came_meanwhile() -> None:
    disk = SlowDisk()
    outbox, writer, _ = rig(disk)
    task = asyncio.create_task(writer.run())
    disk.go.clear()
    outbox.append(1, "bulk", 5, b"x")
    writer.wake()
    await wait_until_async(lambda: disk.inside > 0)
    outbox.append(1, "bulk", 6, b"y")
    outbox.append(2, "event", 6, b"z")
    task.cancel()
    await asyncio.sleep(0)
    assert not task.done()
    disk.go.set()
    await asyncio.gather(task, return_exceptions=True)
    assert held(disk) == {1: 2, 2: 1}


async def test_a_resume_while_a_job_is_under_way_sends_everything_once() -> None:
    disk = SlowDisk()
    outbox, writer, _ = rig(disk)
    task = asyncio.create_task(writer.run())
    outbox.append(1, "bulk", 5, b"a")
    writer.wake()
    await wait_until_async(lambda: outbox.depth("bulk").samples == 1)
    disk.go.clear()
    count = disk.inside
    outbox.append(1, "bulk", 6, b"b")
    writer.wake()
    await wait_until_async(lambda: disk.inside > count)
    assert outbox.take("bulk") is not None
    outbox.resume({})
    disk.go.set()
    await wait_until_async(lambda: outbox.depth("bulk").samples == 2)
    taken = [item.frame.first_seq for item in iter(lambda: outbox.take("bulk"), None)]
    assert taken == [1, 2]
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def test_a_bug_in_a_job_ends_it_instead_of_hiding() -> None:
    outbox, writer, _ = rig(SlowDisk())

    def broken() -> None:
        raise RuntimeError("a bug")

    outbox.restore_reserve = broken  # type: ignore[method-assign]
    with pytest.raises(RuntimeError, match="a bug"):
        await asyncio.wait_for(writer.run(), 60)


def test_events_that_could_not_be_written_wait_before_the_next_try_however_many_they_are() -> None:
    clock = ManualClock()
    outbox = make_outbox(clock=clock, classes=policies())
    outbox.append(1, "event", 5, bytes(500_000))
    assert outbox.due_s("event") == 0.0
    job = outbox.flush_job("event")
    assert job is not None
    outbox.refused(job, DiskError.code)
    wait_s = outbox.due_s("event")
    assert wait_s is not None
    assert wait_s > 0
    clock.advance(wait_s)
    assert outbox.due_s("event") == 0.0


def test_what_gathers_in_front_of_a_slow_disk_is_bounded_over_all_logs() -> None:
    outbox = make_outbox()
    for online in (True, False):
        outbox.online = online
        for _ in range(70):
            outbox.append(1, "bulk", 5, bytes(1 << 20))
    assert outbox._gathered() <= 80 << 20
    assert outbox.lost["bulk"] >= 60
    outbox.append(2, "event", 5, b"still")
    assert outbox.lost["event"] == 0


class DeafDisk(SimDisk):
    """Reads of segments fail while `deaf`; so does the question for free space."""

    deaf = False

    def read(self, name: str, offset: int, size: int) -> bytes:
        if self.deaf and name.startswith("bulk/"):
            raise DiskError("an I/O error")
        return super().read(name, offset, size)

    def free(self) -> tuple[int, int]:
        if self.deaf:
            raise DiskError("an I/O error")
        return super().free()


def deaf_rig() -> tuple[DeafDisk, Outbox]:
    disk = DeafDisk(random.Random(1))
    outbox = make_outbox(disk)
    outbox.online = True
    for number in range(3):
        outbox.append(1, "bulk", number, b"x" * 10)
    accept(outbox)
    outbox.resume({})
    disk.deaf = True
    with pytest.raises(DiskError):
        outbox.take("bulk")
    return disk, outbox


def test_a_disk_that_cannot_be_read_for_a_moment_loses_nothing() -> None:
    disk, outbox = deaf_rig()
    disk.deaf = False
    assert [(item.frame.first_seq, item.frame.last_seq) for item in taken(outbox, "bulk")] == [(1, 3)]


def test_what_can_never_be_read_is_given_up_and_declared() -> None:
    disk, outbox = deaf_rig()
    frames = []
    for _ in range(10):  # one try a session
        outbox.resume({})
        try:
            frames += [item.frame for item in iter(lambda: outbox.take("bulk"), None)]
        except DiskError:
            continue
        break
    assert [(frame.kind, frame.gap().from_seq, frame.gap().to_seq) for frame in frames] == [(Kind.GAP, 1, 3)]
    assert frames[0].gap().reason == "disk_corrupt"
    outbox.append(2, "event", 9, b"still")
    accept(outbox)
    assert len(taken(outbox, "event")) == 1
    assert disk.deaf


def test_what_is_fresh_is_sent_without_reading_it_again() -> None:
    disk = DeafDisk(random.Random(1))
    outbox = make_outbox(disk)
    outbox.online = True
    disk.deaf = True
    for number in range(5):
        outbox.append(1, "bulk", number, b"x" * 10)
        assert [item.frame.last_seq for item in taken(outbox, "bulk")] == [number + 1]
    for number in range(3):  # while nobody takes anything one write waits in memory, and the disk has the rest
        outbox.append(1, "bulk", number, b"x" * 10)
        accept(outbox)
    assert outbox.take("bulk") is not None
    with pytest.raises(DiskError):
        outbox.take("bulk")
    disk.deaf = False
    assert [item.frame.last_seq for item in taken(outbox, "bulk")] == [7, 8]
