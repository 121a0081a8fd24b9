"""A hub whose time stands still, viewers whose sinks take what a test lets them, and runs of samples."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from gateway.api.ws.records import BinaryRecords
from gateway.api.ws.writer import split_frames
from gateway.domain.channel import Channel
from gateway.domain.records import split_records
from gateway.domain.sample import Run
from gateway.live.hub import Hub
from gateway.live.scope import matching
from gateway.live.subscription import TopicSubscription
from gateway.live.viewer import Viewer
from metaros.clock import ManualClock
from metaros.idl.globs import Glob
from metaros.limits import LIMITS, Limits
from metaros.link import SampleColumns

__all__ = ["ListSink", "Rig", "make_channel", "make_run", "make_subscription"]


@dataclass
class SetCall:
    """A call that is set for a time."""

    when_s: float
    run: Callable[[], None]

    def cancel(self) -> None:
        """Call it off."""
        self.run = lambda: None


class ListSink:
    """A sink that takes what comes, or so many writes and no more."""

    def __init__(self, *, takes: int | None = None) -> None:
        self.on_full: Callable[[], None] | None = None
        self.on_drained: Callable[[], None] | None = None
        self.open = True
        self.frames: list[bytes] = []
        self._takes = takes

    def ready(self) -> bool:
        """See Sink."""
        return self.open and self._takes != 0

    def write(self, data: bytes) -> None:
        """See Sink."""
        assert self.ready()
        self.frames.append(data)
        if self._takes is not None:
            self._takes -= 1
        if not self.ready():
            self.shut()

    def shut(self) -> None:
        """It takes nothing more."""
        self.open = False
        assert self.on_full is not None
        self.on_full()

    def reopen(self, *, takes: int | None = None) -> None:
        """It takes again what comes, or so many writes."""
        self.open, self._takes = True, takes
        assert self.on_drained is not None
        self.on_drained()


def make_channel(topic: str = "/r/scan", robot: str = "r") -> Channel:
    """A channel of samples that nobody reads."""
    return Channel(robot=robot, channel_id=1, topic=topic, schema_name="a/msg/B", type_hash="h", schema=b"int8 x")


def make_run(first_seq: int, payloads: list[bytes], channel: Channel | None = None, *, step_ns: int = 1) -> Run:
    """Consecutive samples, stamped by their numbers."""
    offsets = np.concatenate(([0], np.cumsum([len(p) for p in payloads]))).astype(np.int64)
    columns = SampleColumns(
        stream_id=1,
        epoch=1,
        first_seq=first_seq,
        stamps_ns=np.arange(first_seq, first_seq + len(payloads), dtype=np.int64) * step_ns,
        offsets=offsets,
        payload=b"".join(payloads),
    )
    return Run(channel or make_channel(), columns, 5)


def make_subscription(number: int = 1, topics: str = "**", **options: Any) -> TopicSubscription:
    """A subscription to topics of all robots, as binary records."""
    wants = matching(Glob("*"), Glob(topics))
    return TopicSubscription(number, wants, lambda channel: BinaryRecords(number, 7), **options)


class Rig:
    """A hub whose time stands still, with one viewer whose sink takes what `open_` lets it."""

    def __init__(self, *subscriptions: TopicSubscription, limits: Limits = LIMITS) -> None:
        self.clock, self.set_calls = ManualClock(), []
        self.hub = Hub(clock=self.clock, tick_s=0.005, later=self._later, limits=limits)
        self.sink, self.notices = ListSink(), []
        self.viewer = self.join(self.sink)
        for item in subscriptions:
            self.viewer.subscribe(item)

    def join(self, sink: ListSink) -> Viewer:
        """Another viewer, or the first; what it is told of losses is in `notices`."""
        return self.hub.join(sink, on_dropped=lambda *notice: self.notices.append(notice))

    def _later(self, delay_s: float, call: Callable[[], None]) -> SetCall:
        made = SetCall(self.clock.monotonic_s() + delay_s, call)
        self.set_calls.append(made)
        return made

    def pass_time(self, seconds: float = 0.0) -> None:
        """Let time pass, and what is set for it happen in its order."""
        end_s = self.clock.monotonic_s() + seconds
        while due := sorted((c for c in self.set_calls if c.when_s <= end_s + 1e-9), key=lambda c: c.when_s):
            self.clock.advance(max(0.0, due[0].when_s - self.clock.monotonic_s()))
            self.set_calls.remove(due[0])
            due[0].run()
        self.clock.advance(max(0.0, end_s - self.clock.monotonic_s()))

    def got(self, sink: ListSink | None = None) -> list[tuple[int, int, bytes]]:
        """(subscription, seq, payload) of what the sink took since."""
        sink = sink or self.sink
        frames, sink.frames = sink.frames, []
        return [
            (sub, record.seq, record.payload)
            for data in frames
            for _, message in split_frames(data)
            for sub, _, record in split_records(message)
        ]
