"""Saving: one cut for each id, one at a time, and an end in good order."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from edge_agent.blackbox.box import BlackBox
from edge_agent.blackbox.recording_store import RecordingStore
from edge_agent.blackbox.ring import Ring
from edge_agent.blackbox.saver import Saver, span_of
from edge_agent.config.black_box import BlackBoxSettings
from edge_agent.errors import BlackBoxOffError, BusyError, DiskFullError, NothingRecordedError
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from metaros.errors import MetarosError, UsageError
from tests.edge_agent.blackbox.rig import arrival, channel_of
from tests.support.waiting import wait_until_async

TIB, SECOND = 1 << 40, 1_000_000_000


def ident(number: int) -> str:
    return f"01HZZZZZZZZZZZZZZZZZZZZ{number:03d}"


def last_minute(number: int) -> link_pb2.SaveRecording:
    return link_pb2.SaveRecording(recording_id=ident(number), last_ns=60 * SECOND)


class Rig:
    """A black box with a few samples, a shelf, and a saver; `free_bytes` is what the disk says to the cut."""

    def __init__(self, folder: Path) -> None:
        self.clock, self.free_bytes, self.changes = SystemClock(), TIB, 0
        self.gate = threading.Event()  # the cut goes on
        self.gate.set()
        self.box = BlackBox(
            BlackBoxSettings(),
            lambda: Ring(folder / "ring", self.clock, window_s=60, limit_bytes=8 << 20, free=lambda: (TIB, TIB)),
            self.clock,
        )
        self.box.start()
        channel = channel_of("/odom")
        self.box.take([arrival(channel, number, b"x") for number in range(1, 101)])
        self.recordings = RecordingStore(folder / "recordings")
        self.saver = Saver(
            self.box, self.recordings, self.clock, robot_id="r", free=self.free, changed=lambda: self.note_change()
        )

    def free(self) -> tuple[int, int]:
        self.gate.wait(60)
        return self.free_bytes, TIB

    def note_change(self) -> None:
        self.changes += 1


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[Rig]:
    rig = Rig(tmp_path)
    yield rig
    rig.gate.set()
    rig.box.close()


async def test_a_recording_is_on_the_shelf_when_save_returns(rig: Rig) -> None:
    await rig.saver.save(last_minute(1))
    (saved,) = rig.recordings
    assert (saved.recording_id, saved.messages, rig.changes) == (ident(1), 100, 1)
    assert len(rig.recordings.read(ident(1), 0, saved.size_bytes)) == saved.size_bytes
    await rig.saver.save(last_minute(1))
    rig.recordings.remove(ident(1))
    await rig.saver.save(last_minute(1))
    assert list(rig.recordings) == [], "what the gateway has is not cut again"


async def test_calls_for_one_id_are_one_cut_and_others_wait_their_turn(rig: Rig) -> None:
    rig.gate.clear()
    calls = [asyncio.create_task(rig.saver.save(last_minute(number))) for number in (1, 1, 2, 3, 4)]
    await asyncio.sleep(0)
    with pytest.raises(BusyError):
        await rig.saver.save(last_minute(5))
    calls[1].cancel()  # who asked does not wait any more: the cut goes on
    rig.gate.set()
    await asyncio.gather(*calls, return_exceptions=True)
    assert sorted(saved.recording_id for saved in rig.recordings) == [ident(number) for number in (1, 2, 3, 4)]
    assert rig.changes == 4


async def test_what_cannot_be_is_said_and_may_be_asked_again(rig: Rig) -> None:
    with pytest.raises(NothingRecordedError):
        await rig.saver.save(link_pb2.SaveRecording(recording_id=ident(1), from_ns=1, to_ns=2))
    rig.free_bytes = 1
    with pytest.raises(DiskFullError):
        await rig.saver.save(last_minute(1))
    assert [path.name for path in rig.recordings._folder.iterdir()] == []
    rig.free_bytes = TIB
    await rig.saver.save(last_minute(1))
    assert len(rig.recordings) == 1


async def test_an_agent_that_ends_leaves_no_half_file(rig: Rig) -> None:
    rig.gate.clear()
    call = asyncio.create_task(rig.saver.save(last_minute(1)))
    await wait_until_async(lambda: list(rig.recordings._folder.glob("*.partial")))
    closing = asyncio.create_task(rig.saver.close())
    await asyncio.sleep(0)
    rig.free_bytes = 1
    rig.gate.set()
    await closing
    with pytest.raises(MetarosError):
        await call
    assert list(rig.recordings._folder.iterdir()) == []


async def test_without_a_black_box_it_is_off(tmp_path: Path) -> None:
    saver = Saver(
        None, RecordingStore(tmp_path), SystemClock(), robot_id="r", free=lambda: (1, 1), changed=lambda: None
    )
    with pytest.raises(BlackBoxOffError):
        await saver.save(last_minute(1))


def test_a_span_is_by_times_or_by_ages() -> None:
    given = link_pb2.SaveRecording(recording_id=ident(1), from_ns=5, to_ns=9, topics=["**/odom"])
    span = span_of(given, now_ns=100)
    assert (span.from_ns, span.to_ns, span.topics) == (5, 9, ("**/odom",))
    given.last_ns = 30
    span = span_of(given, now_ns=100)
    assert (span.from_ns, span.to_ns) == (70, 100)
    for wrong in (
        link_pb2.SaveRecording(from_ns=9, to_ns=5),
        link_pb2.SaveRecording(from_ns=-1, to_ns=5),
        link_pb2.SaveRecording(last_ns=1000),
        link_pb2.SaveRecording(to_ns=5, topics=["no pattern"]),
        link_pb2.SaveRecording(to_ns=5, topics=["a"] * 257),
    ):
        with pytest.raises(UsageError):
            span_of(wrong, now_ns=100)
