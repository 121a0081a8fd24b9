"""Live samples as replies of Subscribe: made once for all calls that share a form, bounded in bytes for each.

A call that reads too slowly loses its oldest samples, and is told how many; one that reads nothing is ended, see
serving.py.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from gateway.api.grpc.authenticate import Call
from gateway.api.grpc.fields import FieldFaultError
from gateway.api.grpc.query import info
from gateway.api.rest.ranges import full_pattern
from gateway.domain.channel import Channel
from gateway.live.encoding import Block, Encoding, View
from gateway.live.feeds import Feeds, MetricSubscription
from gateway.live.json_view import json_view
from gateway.live.sink import QueueSink
from gateway.live.subscription import TopicSubscription
from metaros._proto import telemetry_pb2
from metaros.idl.globs import Glob
from metaros.limits import LIMITS

__all__ = ["Subscription"]

DEFAULT_QUEUE_BYTES = 1024 * 1024
MAX_RATE_HZ = 1000.0
MAX_PATTERNS = 256
VALUES_HZ = 10.0
Reply = telemetry_pb2.SubscribeReply


@dataclass(frozen=True, slots=True)
class CdrReplies:
    """Samples as they were published."""

    number: int
    view: ClassVar[View[Any] | None] = None

    def encode(self, block: Block) -> bytes:
        """One reply."""
        samples = [
            telemetry_pb2.Sample(seq=it.seq, stamp_ns=it.stamp_ns, receive_ns=it.receive_ns, cdr=it.payload)
            for it in block.records
        ]
        return Reply(channel=self.number, samples=samples).SerializeToString()


@dataclass(frozen=True, slots=True)
class JsonReplies:
    """Samples as JSON, decoded once for all who want that."""

    number: int
    view: ClassVar[View[Any] | None] = json_view

    def encode(self, block: Block) -> bytes:
        """One reply."""
        reply = Reply(channel=self.number)
        for record, shown in zip(block.records, block.views(json_view), strict=True):
            sample = reply.samples.add(seq=record.seq, stamp_ns=record.stamp_ns, receive_ns=record.receive_ns)
            if shown is None:
                sample.undecoded = "sealed" if block.channel.encoding.startswith("sealed/") else "malformed_cdr"
            else:
                sample.json = shown.decode()
        return reply.SerializeToString()


class IntroducingSink(QueueSink):
    """A queue of replies in which each channel is introduced before its first samples."""

    def __init__(self) -> None:
        super().__init__()
        self.channels: dict[int, Channel] = {}  # by number, until they are introduced

    def write(self, data: bytes) -> None:
        """Take a reply in, and before it whose it is, if nobody said so yet."""
        channel = self.channels.pop(first_number(data), None) if self.channels else None
        if channel is not None:
            super().write(Reply(info=info(channel, first_number(data))).SerializeToString())
        super().write(data)


class Subscription:
    """One call of Subscribe."""

    def __init__(self, request: telemetry_pb2.SubscribeRequest, call: Call) -> None:
        self._request = request
        self._call = call
        self._sink = IntroducingSink()
        self._dropped = 0
        self._feeds, self._wake = Feeds(), asyncio.Event()
        check(request)

    async def replies(self) -> AsyncGenerator[bytes, None]:
        """Serialised replies, until the call ends."""
        hub, request = self._call.services.hub, self._request
        viewer = hub.join(self._sink, on_dropped=self._on_dropped)
        unfeed = hub.feed(self._feeds, self._wake.set)
        feeding = asyncio.create_task(self._feed())
        try:
            if request.topics:
                viewer.subscribe(self._samples())
            if request.series:
                self._values()
            while True:
                yield await self._sink.next()
                self._send_dropped()
        finally:
            feeding.cancel()
            unfeed()
            viewer.close()
            await asyncio.gather(feeding, return_exceptions=True)

    def _samples(self) -> TopicSubscription:
        request = self._request
        return TopicSubscription(
            0,
            self._wants(),
            self._encoding,
            max_rate_hz=request.max_rate_hz,
            latest=request.latest,
            queue_bytes=request.queue_bytes or DEFAULT_QUEUE_BYTES,
        )

    def _wants(self) -> Callable[[Channel], bool]:
        registry, sees_robot = self._call.services.registry, self._sees_robot()
        by_namespace: dict[str, tuple[Glob, ...]] = {}

        def wants(channel: Channel) -> bool:
            if not sees_robot(channel.robot):
                return False
            record = registry.find(channel.robot)
            namespace = record.robot.namespace if record is not None else "/"
            globs = by_namespace.get(namespace)
            if globs is None:
                globs = tuple(Glob(full_pattern(item, namespace)) for item in self._request.topics)
                by_namespace[namespace] = globs
            return any(glob.matches(channel.topic) for glob in globs)

        return wants

    def _sees_robot(self) -> Callable[[str], bool]:
        globs, principal = [Glob(item) for item in self._request.robots], self._call.principal
        return lambda robot: principal.sees(robot) and (not globs or any(glob.matches(robot) for glob in globs))

    def _encoding(self, channel: Channel) -> Encoding:
        number = self._call.services.hub.number_of(channel)
        self._sink.channels[number] = channel
        return JsonReplies(number) if self._request.encoding == telemetry_pb2.ENCODING_JSON else CdrReplies(number)

    def _values(self) -> None:
        globs = [Glob(item, separator=".") for item in self._request.series]
        rate_hz = self._request.max_rate_hz or VALUES_HZ
        subscription = MetricSubscription(0, Matching(self._sees_robot()), globs, max_rate_hz=rate_hz)
        for record in self._call.services.registry.all():
            subscription.offer(record.robot.id, record.newest())
        self._feeds.add(subscription)
        self._wake.set()

    async def _feed(self) -> None:
        """Newest values into the queue when they are due; they wait where the call is behind."""
        clock = self._call.services.clock
        while True:
            due_s = self._feeds.due_s()
            delay_s = None if due_s is None else max(0.01, due_s - clock.monotonic_s())
            try:
                async with asyncio.timeout(delay_s):
                    await self._wake.wait()
            except TimeoutError:
                pass
            self._wake.clear()
            if self._sink.ready():
                for message in self._feeds.take(clock.monotonic_s()):
                    stamp_ns = round(message["stamp_ms"] * 1e6)
                    values = telemetry_pb2.SeriesValues(
                        robot=message["robot"], stamp_ns=stamp_ns, values=message["values"]
                    )
                    self._sink.write(Reply(values=[values]).SerializeToString())

    def _on_dropped(self, _number: int, count: int, _total: int) -> None:
        self._dropped += count
        self._send_dropped()

    def _send_dropped(self) -> None:
        """Now, or when there is room."""
        if self._dropped and self._sink.ready():
            self._sink.write(Reply(dropped=self._dropped).SerializeToString())
            self._dropped = 0


@dataclass(frozen=True, slots=True)
class Matching:
    """Robots by a function."""

    sees: Callable[[str], bool]

    def matches(self, robot: str, /) -> bool:
        """Whether the robot is meant."""
        return self.sees(robot)


def check(request: telemetry_pb2.SubscribeRequest) -> None:
    """FieldFaultError names the field that does not fit."""
    for name in ("robots", "topics", "series"):
        patterns = getattr(request, name)
        if len(patterns) > MAX_PATTERNS or any(not 0 < len(item) <= 256 for item in patterns):
            raise FieldFaultError(name, f"{name} has at most {MAX_PATTERNS} patterns of 1 to 256 characters")
    if not request.topics and not request.series:
        raise FieldFaultError("topics", "say which topics or series")
    if not (request.max_rate_hz == 0 or 0.01 <= request.max_rate_hz <= MAX_RATE_HZ):
        raise FieldFaultError("max_rate_hz", f"max_rate_hz is 0, or a number from 0.01 to {MAX_RATE_HZ:g}")
    if request.queue_bytes > LIMITS.viewer_queue_bytes:
        raise FieldFaultError("queue_bytes", f"queue_bytes is at most {LIMITS.viewer_queue_bytes}")


def first_number(data: bytes) -> int:
    """The channel's number of a serialised reply, 0 where it begins with another field."""
    if not data or data[0] != 0x08:
        return 0
    number = shift = 0
    for byte in data[1:6]:
        number |= (byte & 0x7F) << shift
        shift += 7
        if byte < 0x80:
            break
    return number
