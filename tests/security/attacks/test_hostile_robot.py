"""A robot of the fleet turns against its gateway: floods, lies, copies. Others notice nothing; memory is bounded."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.channel import Series
from gateway.domain.identity import Admitted
from gateway.domain.robot import Robot
from gateway.errors import ProtocolError
from gateway.history.recordings.uploads import MAX_OFFERS, Uploads
from gateway.ingest.events import Closed
from gateway.ingest.registry import REMEMBERED_SERIES, RIVAL_TRIES, RobotRecord
from gateway.ingest.streams import MAX_EPOCHS, StreamTable
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.limits import LIMITS
from tests.gateway.ingest.test_links import Rig as LinksRig
from tests.gateway.ingest.test_session import CONTROL, DATA, Rig, hello

pytestmark = pytest.mark.integration

SCHEMA = b"s" * LIMITS.schema_bytes


def ended(events: list[Any]) -> str:
    """Why the session is over; "" when it is not."""
    return next((event.message for event in events if isinstance(event, Closed)), "")


def channel(number: int, schema: bytes = SCHEMA) -> link_pb2.Announce:
    """One channel, as large as it may be."""
    frame = link_pb2.Announce()
    one = frame.channels.add(channel_id=number, topic=f"/r1/t{number}", schema_name="a/msg/B", schema=schema)
    setattr(one, "class", 3)
    return frame


def test_schemas_are_bounded_in_all_and_may_be_reported_again() -> None:
    rig, most = Rig(), LIMITS.schemas_bytes // LIMITS.schema_bytes
    for _again in range(3):
        for number in range(100, 100 + most):
            assert ended(rig.receive(announce=channel(number))) == ""
    assert "schemas" in ended(rig.receive(announce=channel(99)))


def test_statistics_are_bounded() -> None:
    rig = Rig()
    rates = [link_pb2.TopicRate(channel_id=1)] * 4096
    assert ended(rig.receive(statistics=link_pb2.TopicStatistics(topics=rates), lane=CONTROL)) == ""
    huge = link_pb2.TopicStatistics()
    huge.ParseFromString(b"\xa2\x7d" + b"\x80\x80\x80\x01" + b"x" * (2 << 20))  # a field that nobody knows
    assert "statistics" in ended(rig.receive(statistics=huge, lane=CONTROL))


def test_epochs_are_bounded_over_all_sessions() -> None:
    streams = StreamTable()
    for start in range(0, MAX_EPOCHS, 4096):
        streams.written_by(hello(epochs=range(start + 1, start + 4097), writers=["w"]))
    streams.written_by(hello(epochs=range(1, 4097), writers=["v"]))
    with pytest.raises(ProtocolError, match="epochs"):
        streams.written_by(hello(epochs=[MAX_EPOCHS + 1], writers=["w"]))
    assert len(streams.writers) == MAX_EPOCHS


def test_series_of_one_process_after_the_other_are_forgotten() -> None:
    record = RobotRecord(Robot("r1"), seen_ns=0)
    for process in range(8):
        record.begin(Robot("r1"), session_id=bytes([process]) * 16, session_number=process)
        record.announce([], [Series(f"s{process}_{n}", "/r1/t", "f") for n in range(LIMITS.series_per_robot)])
        record.announce([], [Series("kept", "/r1/t", "f")])
    assert len(record.series) == REMEMBERED_SERIES
    assert "kept" in record.series


def test_two_processes_at_a_time_are_reported_from_one_that_came_back() -> None:
    record = RobotRecord(Robot("r1"), seen_ns=0)
    turned = [record.fenced(b"copy", received_s=5.0 * turn - 1, now_s=5.0 * turn) for turn in range(1, RIVAL_TRIES + 1)]
    assert turned == [False] * (RIVAL_TRIES - 1) + [True]
    # Its clock was set back, and its own former session, which says nothing any more, is not yet held for dead.
    assert not any(record.fenced(b"back", received_s=99.0, now_s=100.0 + 5.0 * turn) for turn in range(6))
    # The former session spoke once more, out of a buffer.
    turns = [(1.0, 2.0), (3.0, 7.0), (3.0, 12.0), (3.0, 17.0)]
    assert not any(record.fenced(b"late", received_s=received_s, now_s=now_s) for received_s, now_s in turns)
    for stranger in range(1000):
        record.fenced(stranger.to_bytes(16, "big"), received_s=0.0, now_s=1.0)
    assert len(record._rivals) <= 16


HOSTILE: dict[str, dict[str, Any]] = {
    "a second Hello": {"hello": hello()},
    "a Proof nobody asked for": {"proof": link_pb2.Proof(signature=b"x")},
    "numbers out of order": {"gap": link_pb2.Gap(stream_id=1, epoch=1, from_seq=5, to_seq=2)},
    "a stream of nobody": {"gap": link_pb2.Gap(stream_id=77, epoch=1, from_seq=1, to_seq=2)},
    "a recording on the wrong lane": {"recording": link_pb2.RecordingPart(recording_id="x")},
    "nothing": {},
}


@pytest.mark.parametrize("frame", HOSTILE)
def test_what_breaks_the_protocol_ends_the_own_session(frame: str) -> None:
    rig = Rig()
    assert ended(rig.receive(lane=DATA, **HOSTILE[frame])) != ""
    assert rig.receive(lane=DATA, announce=channel(50)) == []


async def test_a_robot_that_keeps_the_store_busy_keeps_nobody_else_waiting(tmp_path: Path) -> None:
    rig, never = LinksRig(tmp_path), asyncio.Event()
    real = rig.store.streams

    async def streams(robot: str) -> dict[tuple[int, int], int]:
        if robot == "hog":
            await never.wait()
        return await real(robot)

    rig.store.streams = streams  # type: ignore[method-assign, assignment]
    hog = asyncio.create_task(rig.links.join(hello(robot_id="hog", namespace="/hog"), Admitted("hog")))
    await asyncio.sleep(0)
    async with asyncio.timeout(60):
        await rig.links.join(hello(), Admitted("r1"))
    assert not hog.done()
    hog.cancel()
    await asyncio.gather(hog, return_exceptions=True)
    await rig.store.close()


def test_offers_of_one_robot_leave_room_for_the_others() -> None:
    spawned: list[Any] = []
    nothing: Any = None  # what is spawned is never run
    uploads = Uploads(
        nothing,
        nothing,
        nothing,
        send=lambda robot, wanted: None,
        spawn=spawned.append,
        on_thread=nothing,
        clock=ManualClock(),
        limits=LIMITS,
    )
    for number in range(10_000):
        uploads.part("hog", link_pb2.RecordingPart(recording_id=f"r{number}"))
    assert len(spawned) == MAX_OFFERS
    uploads.part("arm", link_pb2.RecordingPart(recording_id="r0"))  # its own, whoever else names it
    assert len(spawned) == MAX_OFFERS + 1
    for waiting in spawned:
        waiting.close()
