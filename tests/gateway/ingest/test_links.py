"""Sessions at work before a real store: who is welcome when, quotas over sessions, what reaches the viewers."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from gateway.domain.identity import Admitted, Peer
from gateway.domain.sample import Run
from gateway.errors import FencedError
from gateway.ingest.lane_server import serve_lane
from gateway.ingest.links import Lane, LinkHooks, Links
from gateway.ingest.quota import Quota
from gateway.ingest.registry import Registry
from gateway.store import Store
from gateway.store.retention import Retention
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.link import pack_batch
from tests.gateway.ingest.test_session import BACKFILL, CONTROL, DATA, EPOCH, hello
from tests.support.waiting import wait_until_async


class Rig:
    """Links, and a store that is started when a test says so."""

    def __init__(self, folder: Path, *, quota: Quota | None = None) -> None:
        self.clock = ManualClock()
        retention = Retention(age_s=100.0, size_bytes=1 << 30)
        self.store = Store(folder, clock=self.clock, retention=retention, queue_bytes=1 << 20)
        self.registry = Registry()
        self.seen: list[Run] = []
        hooks = LinkHooks(
            on_samples=self.seen.append,
            on_values=lambda robot, values: None,
            on_channels=lambda robot: None,
            on_online=lambda robot, online: None,
            on_result=lambda robot, result: None,
        )
        self.links = Links(self.registry, self.store, hooks, clock=self.clock, quota=quota)
        self.lanes: dict[int, Lane] = {}

    def start(self) -> None:
        """Commits happen from now on."""
        self.store.start(self.links.committed, self.links.refused)

    async def connect(self, number: int, **changes: Any) -> None:
        """A session with all lanes and three channels: 1 bulk, 2 live, 3 history of 2."""
        for lane in (CONTROL, DATA, BACKFILL):
            self.lanes[lane] = await self.links.join(hello(lane, session_number=number, **changes), Admitted("r1"))
            await self.receive(announce=announce(), lane=lane)

    async def receive(self, *, lane: int = DATA, **frame: Any) -> None:
        """A frame of the agent."""
        await self.links.receive(self.lanes[lane], link_pb2.AgentFrame(**frame))

    async def samples(self, first_seq: int, count: int, *, stream: int = 1) -> None:
        """A batch."""
        batch = pack_batch(stream, EPOCH, first_seq, list(range(count)), [b"x"] * count)
        await self.receive(batches=link_pb2.Batches(batches=[batch]))

    async def hear(self, kind: str, lane: int = DATA) -> Any:
        """The next frame of that kind on a lane."""
        while True:
            frame = await asyncio.wait_for(self.lanes[lane].outbox.next(), 60)
            assert frame is not None
            if frame.WhichOneof("frame") == kind:
                return getattr(frame, kind)


def announce() -> link_pb2.Announce:
    """Three channels."""
    frame = link_pb2.Announce()
    for number, (topic, delivery) in enumerate((("a", 3), ("b", 4), ("b", 3)), 1):
        channel = frame.channels.add(channel_id=number, topic=f"/r1/{topic}", schema_name="std_msgs/msg/String")
        setattr(channel, "class", delivery)
    frame.channels[1].history_rate_hz, frame.channels[2].history = 1.0, True
    return frame


@pytest.fixture
async def rig(tmp_path: Path) -> AsyncIterator[Rig]:
    """Links without a quota."""
    made = Rig(tmp_path)
    yield made
    await made.store.close()


async def test_another_writer_waits_a_moment_for_what_is_on_its_way_to_the_store(rig: Rig) -> None:
    await rig.connect(7, writers=["w1"], epochs=[EPOCH])
    await rig.samples(1, 5)
    again = link_pb2.AgentFrame(hello=hello(CONTROL, session_number=8, writers=["w1", "w2"], epochs=[EPOCH]))
    said: list[link_pb2.GatewayFrame] = []

    async def read() -> link_pb2.AgentFrame:
        return again

    async def write(frame: link_pb2.GatewayFrame) -> None:
        said.append(frame)

    assert await serve_lane(rig.links, read, write, peer=Peer(local=True))
    assert [(frame.goodbye.code, frame.goodbye.retry_after_ms) for frame in said] == [("unsettled", 50)]
    rig.start()
    await rig.store.flush()
    streams = rig.registry.get("r1").streams
    assert streams is not None
    await wait_until_async(lambda: not streams.unsettled(again.hello))
    lane = await rig.links.join(again.hello, Admitted("r1"))
    welcome = await asyncio.wait_for(lane.outbox.next(), 60)
    assert welcome is not None
    assert [(mark.stream_id, mark.seq) for mark in welcome.welcome.watermarks] == [(1, 5)]


async def test_a_hello_that_breaks_the_rules_is_kept_away_longer(rig: Rig) -> None:
    said: list[link_pb2.GatewayFrame] = []

    async def read() -> link_pb2.AgentFrame:
        return link_pb2.AgentFrame(hello=hello(CONTROL, protocol=9))

    async def write(frame: link_pb2.GatewayFrame) -> None:
        said.append(frame)

    await serve_lane(rig.links, read, write, peer=Peer(local=True))
    assert [(frame.goodbye.code, frame.goodbye.retry_after_ms) for frame in said] == [("protocol", 1000)]


async def test_history_goes_to_the_store_and_not_to_viewers(rig: Rig) -> None:
    rig.start()
    await rig.connect(7)
    await rig.samples(1, 3, stream=3)
    await rig.samples(1, 2, stream=2)
    assert [run.channel.channel_id for run in rig.seen] == [2]
    (mark,) = (await rig.hear("ack")).watermarks
    assert (mark.stream_id, mark.seq) == (3, 3)
    assert rig.registry.get("r1").counts.samples == 5


async def test_a_quota_outlives_sessions_and_everything_is_stored_in_the_end(tmp_path: Path) -> None:
    rig = Rig(tmp_path, quota=Quota(messages_per_s=100, bytes_per_s=1 << 20))
    rig.start()
    await rig.connect(7)
    assert (await rig.hear("welcome")).window_bytes == 1 << 19
    await rig.samples(1, 250)
    await rig.samples(1, 9, stream=2)
    assert rig.registry.get("r1").counts.over_quota == 9

    await rig.connect(8)
    await rig.samples(251, 50)
    later = await rig.hear("retry_later")
    assert later.reason == "rate"
    await rig.samples(301, 50)  # under way when it was told
    rig.clock.advance(later.retry_after_ms / 1000)
    await rig.receive(resumed=link_pb2.Resumed(token=later.token))
    await rig.samples(251, 50)
    await rig.samples(301, 50)
    counts = rig.registry.get("r1").counts
    assert (counts.samples, counts.put_off, counts.over_quota, counts.duplicates) == (350, 1, 9, 0)
    await rig.store.flush()
    assert await rig.store.streams("r1") == {(1, EPOCH): 350}
    await rig.store.close()


async def test_a_session_that_another_gateway_has_anew_ends_here(rig: Rig) -> None:
    await rig.connect(7)
    assert rig.links.has("r1")
    rig.links.fence("r1", 6)  # late: the one here is newer
    rig.links.fence("r2", 9)
    assert rig.links.has("r1")
    rig.links.fence("r1", 8)
    assert (await rig.hear("goodbye")).code == "fenced"
    assert not rig.links.has("r1")


async def test_an_older_hello_than_what_lives_remote_is_refused_without_an_alarm(rig: Rig) -> None:
    await rig.connect(7)
    cloned: list[str] = []
    rig.links.authenticator.cloned = cloned.append  # type: ignore[method-assign]
    record = rig.registry.get("r1")
    rig.links.fence("r1", 9)
    record.set_owner("another", 9, wall_ns=0)
    for number in (7, 8, 8, 9, 9):
        with pytest.raises(FencedError, match="another gateway"):
            await rig.connect(number, session_id=bytes([number]) * 16)
        rig.clock.advance(5.0)
    await rig.connect(10)
    assert (rig.links.has("r1"), record.owner_gateway, cloned) == (True, "", [])


async def test_robots_are_sent_away_so_that_they_come_back_one_after_the_other(rig: Rig) -> None:
    lanes = []
    for name in ("r1", "r2", "r3"):
        await rig.connect(7, robot_id=name, session_id=name.encode() * 8)
        lanes.append(rig.lanes)
        rig.lanes = {}
    rig.links.close()
    reported = []
    for rig.lanes in lanes:
        reported.append((await rig.hear("goodbye")).retry_after_ms)
    assert reported == [200, 202, 204]


async def test_a_process_that_is_back_after_another_one_remote_is_one_of_two(rig: Rig) -> None:
    cloned: list[str] = []
    rig.links.authenticator.cloned = cloned.append  # type: ignore[method-assign]
    one, two = b"1" * 16, b"2" * 16
    await rig.connect(1, session_id=one)
    assert rig.links.process_of("r1") == one
    for number, remote in ((2, one), (3, one)):  # it went to another gateway and came back
        rig.links.started_remotely("r1", remote)
        await rig.connect(number, session_id=one)
    assert cloned == []
    rig.links.started_remotely("r1", two)  # it was started anew, or it has a copy
    rig.links.started_remotely("r2", two)
    assert cloned == []
    await rig.connect(4, session_id=one)
    assert cloned == ["r1"]
