"""Gateways as far as a mirror and live samples need them: registries and hubs of their own, and the tests' mesh."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import asynccontextmanager

import numpy as np

from gateway.api.ws.records import BinaryRecords
from gateway.api.ws.writer import split_frames
from gateway.cluster.live import Live
from gateway.cluster.mirror.mirror import Mirror
from gateway.domain.channel import Channel, Series
from gateway.domain.records import split_records
from gateway.domain.robot import Robot
from gateway.domain.sample import Rows, Run
from gateway.ingest.registry import Registry, RobotRecord
from gateway.live.hub import Hub
from gateway.live.subscription import TopicSubscription
from gateway.live.viewer import Viewer
from metaros.clock import Clock, SystemClock
from metaros.link import SampleColumns
from tests.support.gateways.fake_mesh import FakeMeshes

__all__ = ["Replica", "Seen", "channel", "make_run", "replicas"]


def channel(robot: str, number: int, topic: str, *, delivery: str = "live", forward: bool = True) -> Channel:
    """An announced channel."""
    return Channel(
        robot=robot,
        channel_id=number,
        topic=topic,
        schema_name="a/msg/B",
        type_hash="RIHS01_1",
        schema_encoding="ros2msg",
        schema=f"int8 {topic.strip('/').replace('/', '_')}".encode(),
        qos="reliable",
        delivery=delivery,
        max_rate_hz=5.0,
        forward=forward,
    )


def make_run(of: Channel, payloads: Sequence[bytes], *, first_seq: int = 1, stamp_ns: int = 1, step_ns: int = 1) -> Run:
    """Consecutive samples."""
    lengths = [0, *map(len, payloads)]
    columns = SampleColumns(
        stream_id=of.channel_id,
        epoch=7,
        first_seq=first_seq,
        stamps_ns=np.arange(len(payloads), dtype=np.int64) * step_ns + stamp_ns,
        offsets=np.cumsum(np.array(lengths, np.int64)),
        payload=b"".join(payloads),
    )
    return Run(of, columns, 99)


class Seen:
    """A viewer's sink that takes everything."""

    def __init__(self) -> None:
        self.on_full = self.on_drained = None
        self.frames: list[bytes] = []

    def ready(self) -> bool:
        """Always."""
        return True

    def write(self, data: bytes, /) -> None:
        """Take it."""
        self.frames.append(data)

    @property
    def payloads(self) -> list[bytes]:
        """Of all samples that came, in order."""
        return [
            bytes(record.payload)
            for data in self.frames
            for _, frame in split_frames(data)
            for _, _, record in split_records(frame)
        ]


class Replica:
    """One gateway; its robots' links are what a test says."""

    def __init__(self, meshes: FakeMeshes, gateway_id: str, *, clock: Clock | None = None) -> None:
        self.clock = clock or SystemClock()
        self.registry = Registry()
        self.hub = Hub(clock=self.clock, tick_s=0.001)
        self.mesh = meshes.join(gateway_id)
        self.mirror = Mirror(self.mesh, self.registry, self.hub, clock=self.clock, look_s=0.05)
        self.live = Live(self.mesh, self.registry, self.hub, clock=self.clock, tick_s=0.001)
        self.mirror.watch(self.live.on_owner)
        self.sessions = 0

    def link(
        self, robot: str, number: int, *, process: bytes = b"p", labels: dict[str, str] | None = None
    ) -> RobotRecord:
        """A robot's link to this gateway becomes whole."""
        who = Robot(robot, f"/{robot}", "bench", "1.0", labels or {})
        record = self.registry.add(RobotRecord(who, seen_ns=1))
        record.begin(who, session_id=process, session_number=number)
        record.set_online(True, wall_ns=self.clock.wall_ns())
        self.mirror.on_online(robot, True)
        return record

    def unlink(self, robot: str) -> None:
        """It ends."""
        self.registry.get(robot).set_online(False, wall_ns=self.clock.wall_ns())
        self.mirror.on_online(robot, False)

    def announce(self, robot: str, channels: Sequence[Channel], series: Sequence[str] = ()) -> None:
        """The robot declares channels, and series by their names."""
        self.registry.get(robot).announce(channels, [Series(name, "/t", name) for name in series])
        self.mirror.on_channels(robot)

    def values(self, robot: str, **values: float) -> None:
        """Newest values of series came, each with the stamp 1000."""
        series = tuple(Series(name, "/t", name) for name in values)
        stamps, index = np.full(len(series), 1000, np.int64), np.arange(len(series), dtype=np.uint32)
        rows = Rows(series, index, stamps, np.array(list(values.values())))
        newest = self.registry.get(robot).count_rows(rows, 0, wall_ns=self.clock.wall_ns(), now_s=0.0)
        self.mirror.on_values(robot, newest)

    def publish(self, run: Run) -> None:
        """Samples came over the link."""
        self.registry.get(run.channel.robot).count_run(run, 0, now_s=self.clock.monotonic_s())
        self.hub.publish(run)
        self.live.publish(run)

    def look(self, topic: str = "", *, robot: str = "", rate_hz: float = 0.0) -> tuple[Viewer, Seen]:
        """Somebody looks at a topic, of all robots unless one is named; "": at all topics."""

        def wants(found: Channel) -> bool:
            return found.topic == (topic or found.topic) and found.robot == (robot or found.robot)

        seen = Seen()
        viewer = self.hub.join(seen)
        viewer.subscribe(TopicSubscription(1, wants, lambda of: BinaryRecords(1, of.channel_id), max_rate_hz=rate_hz))
        return viewer, seen


@asynccontextmanager
async def replicas(meshes: FakeMeshes, *names: str, clock: Clock | None = None) -> AsyncIterator[list[Replica]]:
    """So many gateways at work."""
    made = [Replica(meshes, name, clock=clock) for name in names]
    tasks = [asyncio.create_task(part.run()) for replica in made for part in (replica.mirror, replica.live)]
    try:
        yield made
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        for replica in made:
            replica.hub.close()
