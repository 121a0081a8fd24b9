"""The gateway's half of a link session: frames and the time in, events out. No I/O, no clock of its own.

A session is one robot's (session id, session number) with three lanes. The first frame of a lane is its Hello,
answered with a Welcome. Whatever breaks the protocol ends the whole session with a Goodbye that says why;
the agent comes back with a higher session number and resumes at the watermarks. A session that is silent on all lanes
for `dead_after_s` is dead.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from gateway.domain.channel import LIVE, METRIC, METRIC_STREAM, Channel
from gateway.domain.distinct import distinct
from gateway.domain.robot import Robot
from gateway.domain.sample import Gap, Rows, Run
from gateway.domain.trace import RobotTimes, read_trace
from gateway.errors import ForkedError, LinkError, ProtocolError, UnsettledError
from gateway.ingest.events import (
    Announced,
    Arrived,
    Closed,
    Event,
    GapDeclared,
    Measured,
    Online,
    OverQuota,
    Reported,
    Resulted,
    RowsArrived,
    Send,
    WriterKnown,
)
from gateway.ingest.frame_checks import ROS_FRAMES, read_leases, read_recording, read_ros, read_twin
from gateway.ingest.handshake import LANES, check_hello, read_channel
from gateway.ingest.quota import Meter
from gateway.ingest.series_table import SeriesTable
from gateway.ingest.streams import StreamTable
from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.limits import LIMITS, Limits
from metaros.link import CHANNEL_MASK, Reassembler, SampleColumns, decompress, unpack_metrics

__all__ = ["Session"]

CONTROL, DATA, BACKFILL = LANES
REMEMBERED_BEATS = 4
WHOLE_AFTER = 4  # times as long as silence: lanes may wait in a queue of thousands


@dataclass(slots=True)
class _Lane:
    """What is remembered of one open lane."""

    received_s: float
    pieces: Reassembler
    live_pieces: Reassembler  # these go on while durable frames are refused
    refusing: int = 0  # the token that ends it; durable frames are dropped until then
    skipping: set[int] = field(default_factory=set)  # live streams of whose large sample the pieces are dropped


class Session:
    """One robot's session. Every method returns the events it caused, in order."""

    def __init__(
        self,
        hello: link_pb2.Hello,
        streams: StreamTable,
        *,
        gateway_id: str,
        store_id: str,
        limits: Limits = LIMITS,
        meter: Meter | None = None,
        fetch_token: str = "",
    ) -> None:
        """Raises ProtocolError when the Hello is not acceptable; `streams` and `meter` outlive the session."""
        self.robot: Robot = check_hello(hello, limits=limits)
        self.session_id = hello.session_id
        self.number = int(hello.session_number)
        self.channels: dict[int, Channel] = {}
        self._series = SeriesTable()
        self._streams = streams
        self._gateway_id = gateway_id
        self._store_id = store_id
        self._limits = limits
        self._meter = meter
        self._fetch_token = fetch_token
        self._lanes: dict[int, _Lane] = {}
        self._closed = False
        self._opened_s = math.inf  # its first lane
        self._beat_s = 0.0
        self._beats: dict[int, float] = {}
        self._last_beat: tuple[int, float] | None = None
        self._handlers: dict[str, Callable[[int, link_pb2.AgentFrame, float, int], list[Event]]] = {
            "announce": self._on_announce,
            "batches": self._on_batches,
            "metrics": self._on_metrics,
            "gap": self._on_gap,
            "statistics": self._on_statistics,
            "result": lambda lane, frame, now_s, wall_ns: [Resulted(frame.result)],
            "heartbeat": self._on_heartbeat,
            "resumed": self._on_resumed,
            "recording": lambda lane, frame, now_s, wall_ns: [read_recording(lane, frame.recording, limits=limits)],
            "twin": lambda lane, frame, now_s, wall_ns: [read_twin(lane, frame.twin, limits=limits)],
            "leases_taken": lambda lane, frame, now_s, wall_ns: [read_leases(lane, frame.leases_taken)],
            **dict.fromkeys(ROS_FRAMES, lambda lane, frame, now_s, wall_ns: [read_ros(lane, frame)]),
        }
        self._token = 0
        self._schema_bytes = 0

    @property
    def online(self) -> bool:
        """True while all lanes are open."""
        return not self._closed and all(lane in self._lanes for lane in LANES)

    @property
    def received_s(self) -> float:
        """When something came on any lane, by the monotonic clock."""
        return max((lane.received_s for lane in self._lanes.values()), default=-math.inf)

    def open_lane(self, hello: link_pb2.Hello, *, now_s: float, wall_ns: int) -> list[Event]:
        """A lane's Hello, answered with a Welcome.

        Raises:
            ProtocolError: this Hello opens no lane here; only its own connection gets the Goodbye.
            ForkedError, UnsettledError: likewise; its outbox is a copy of one that was here, or for a moment.
        """
        check_hello(hello, limits=self._limits)
        if self._closed or hello.lane in self._lanes:
            raise ProtocolError("this lane of the session is open already, or the session is over")
        if self._streams.forked(hello):
            raise ForkedError(f"another copy of the outbox of {self.robot.id} has spoken under its epoch")
        if self._streams.unsettled(hello):
            raise UnsettledError("what the writer before this one sent is being stored")
        writers = self._streams.written_by(hello)
        self._lanes[hello.lane] = _Lane(now_s, Reassembler(limits=self._limits), Reassembler(limits=self._limits))
        self._opened_s = min(self._opened_s, now_s)
        lost: list[Event] = []
        self._streams.begin(hello.streams)
        if writers:
            lost.append(WriterKnown(writers))
        for stream_id, epoch, gap in self._streams.missing(hello.streams, wall_ns=wall_ns):
            lost += self._skip(stream_id, epoch, gap)
        events: list[Event] = [Send(hello.lane, self._welcome(hello)), *lost]
        if self.online:
            events.append(Online())
            events += self._beat(now_s, wall_ns)
        return events

    def receive(self, lane: int, frame: link_pb2.AgentFrame, *, now_s: float, wall_ns: int) -> list[Event]:
        """A frame after the Hello."""
        if self._closed or lane not in self._lanes:
            return []
        self._lanes[lane].received_s = now_s
        events: list[Event] = []
        try:
            handler = self._handlers.get(frame.WhichOneof("frame") or "")
            if handler is None:
                raise ProtocolError("a frame is empty, or a second Hello")
            events += handler(lane, frame, now_s, wall_ns)
        except (LinkError, FrameError) as error:
            self._streams.refuse()  # of this frame's batches some were counted in, and none goes to the store
            code = error.code if isinstance(error, LinkError) else ProtocolError.code
            events += self.close(code, str(error))
        return events

    def committed(self, watermarks: Iterable[tuple[int, int, int]]) -> list[Event]:
        """(stream, epoch, seq) that a commit stored: one cumulative Ack on the data lane."""
        ack = link_pb2.Ack(
            watermarks=[link_pb2.Watermark(stream_id=s, epoch=epoch, seq=seq) for s, epoch, seq in watermarks]
        )
        lane = DATA if DATA in self._lanes else CONTROL
        if self._closed or lane not in self._lanes or not ack.watermarks:
            return []
        return [Send(lane, link_pb2.GatewayFrame(ack=ack))]

    def refuse(self, reason: str, *, retry_after_ms: int) -> list[Event]:
        """Nothing durable can be taken now: every lane is told when to send again what was not acknowledged."""
        if not self.online:
            return []
        self._streams.refuse()
        frames = (self._put_off(number, reason, retry_after_ms) for number in self._lanes)
        return [event for events in frames for event in events]

    def touch(self, lane: int, *, now_s: float) -> None:
        """The shell was not reading this lane for a reason of its own: silence does not count."""
        if lane in self._lanes:
            self._lanes[lane].received_s = now_s

    def tick(self, *, now_s: float, wall_ns: int, since_s: float = -math.inf) -> list[Event]:
        """Heartbeats that are due, and the end of a session that went silent, as far as the gateway listened.

        Call once a second or so; `since_s`: before that the gateway itself was late.
        """
        if self._closed or not self._lanes:
            return []
        if now_s - max(self.received_s, since_s) >= self._limits.dead_after_s:
            return self.close("dead", f"nothing heard for {self._limits.dead_after_s:g} s")
        if not self.online and now_s - max(self._opened_s, since_s) >= WHOLE_AFTER * self._limits.dead_after_s:
            return self.close("split", "its other lanes are not here: a load balancer sent them to another gateway?")
        if CONTROL in self._lanes and now_s - self._beat_s >= self._limits.heartbeat_s:
            return self._beat(now_s, wall_ns)
        return []

    def close(self, code: str, message: str, *, retry_after_ms: int = 0) -> list[Event]:
        """End the session: Goodbye on every lane, then Closed. Nothing happens the second time."""
        if self._closed:
            return []
        self._closed = True
        events: list[Event] = []
        for lane in self._lanes:
            events += self._goodbye(lane, code, message, retry_after_ms=retry_after_ms)
        self._lanes.clear()
        return [*events, Closed(code, message)]

    def lane_ended(self) -> list[Event]:
        """A lane's connection ended: the session ends with it, the agent reopens both."""
        return self.close("", "a lane's connection ended")

    def _put_off(self, number: int, reason: str, retry_after_ms: int) -> list[Event]:
        """Durable frames of a lane are dropped until its Resumed."""
        lane = self._lanes[number]
        if lane.refusing:
            return []
        self._token += 1
        lane.refusing, lane.pieces = self._token, Reassembler(limits=self._limits)
        later = link_pb2.RetryLater(token=self._token, retry_after_ms=retry_after_ms, reason=reason)
        return [Send(number, link_pb2.GatewayFrame(retry_later=later))]

    def _welcome(self, hello: link_pb2.Hello) -> link_pb2.GatewayFrame:
        known = [
            link_pb2.Watermark(stream_id=stream_id, epoch=epoch, seq=seq)
            for (stream_id, epoch), seq in self._streams.marks(hello).items()
        ]
        welcome = link_pb2.Welcome(
            gateway_id=self._gateway_id,
            store_id=self._store_id,
            watermarks=known,
            window_bytes=self._limits.window_bytes,
            window_batches=self._limits.window_batches,
            heartbeat_s=self._limits.heartbeat_s,
            fetch_token=self._fetch_token,
            stored_writers=[
                link_pb2.EpochWriter(epoch=epoch, writer=writer)
                for epoch, writer in self._streams.stored_writers(hello).items()
            ],
            twin=True,
            graph=True,
        )
        return link_pb2.GatewayFrame(welcome=welcome)

    @staticmethod
    def _goodbye(lane: int, code: str, message: str, *, retry_after_ms: int = 0) -> list[Event]:
        if not code:
            return []
        goodbye = link_pb2.Goodbye(code=code, message=message[:1024], retry_after_ms=retry_after_ms)
        return [Send(lane, link_pb2.GatewayFrame(goodbye=goodbye))]

    def _on_statistics(self, lane: int, frame: link_pb2.AgentFrame, now_s: float, wall_ns: int) -> list[Event]:
        if frame.statistics.ByteSize() > self._limits.statistics_bytes:
            raise ProtocolError(f"statistics have at most {self._limits.statistics_bytes} bytes")
        return [Reported(frame.statistics)]

    def _on_announce(self, lane: int, frame: link_pb2.AgentFrame, now_s: float, wall_ns: int) -> list[Event]:
        channels = [read_channel(self.robot.id, c, limits=self._limits) for c in frame.announce.channels]
        for channel in channels:
            known = self.channels.get(channel.channel_id)
            if known is not None and meaning(known) != meaning(channel):
                raise ProtocolError(f"channel {channel.channel_id} was {known.topic}, it cannot become {channel.topic}")
            self.channels[channel.channel_id] = channel
            self._schema_bytes += len(channel.schema) - (len(known.schema) if known is not None else 0)
        if self._schema_bytes > self._limits.schemas_bytes:
            raise ProtocolError(f"the schemas of one robot have at most {self._limits.schemas_bytes} bytes")
        series = self._series.announce(frame.announce.series)
        if len(self.channels) > self._limits.channels_per_robot or len(self._series) > self._limits.series_per_robot:
            raise ProtocolError("too many channels or series for one robot")
        return [Announced(tuple(channels), series)]

    def _on_batches(self, lane: int, frame: link_pb2.AgentFrame, now_s: float, wall_ns: int) -> list[Event]:
        events: list[Event] = []
        for batch in frame.batches.batches:
            channel = self.channels.get(batch.stream_id & CHANNEL_MASK)
            if channel is None:
                raise ProtocolError(f"stream {batch.stream_id} was not announced")
            if self._lanes[lane].refusing and channel.delivery != LIVE:
                continue
            if over := self._over_quota(lane, batch, channel, now_s):
                events += over
                continue
            pieces = self._lanes[lane].live_pieces if channel.delivery == LIVE else self._lanes[lane].pieces
            columns = pieces.feed(decompress(batch, limits=self._limits))
            if columns is not None:
                events += self._samples(lane, channel, columns, wall_ns, read_trace(batch))
        return events

    def _over_quota(self, lane: int, batch: link_pb2.Batch, channel: Channel, now_s: float) -> list[Event]:
        """What a batch causes that is more than the robot may send; nothing where it may."""
        if self._meter is None:
            return []
        skipping = self._lanes[lane].skipping
        if batch.chunk_index and batch.stream_id in skipping:
            return [OverQuota()]  # counted with its first piece
        skipping.discard(batch.stream_id)
        wait_s = self._meter.batch(batch, channel.delivery, now_s)
        if not wait_s:
            return []
        if channel.delivery != LIVE:
            return self._wait(lane, wait_s)
        skipping.add(batch.stream_id)
        return [OverQuota(batch.count)]

    def _wait(self, lane: int, wait_s: float) -> list[Event]:
        return [OverQuota(put_off=True), *self._put_off(lane, "rate", math.ceil(wait_s * 1000))]

    def _samples(
        self, lane: int, channel: Channel, columns: SampleColumns, wall_ns: int, trace: RobotTimes | None
    ) -> list[Event]:
        if channel.delivery == LIVE:
            return [Arrived(Run(channel, columns, wall_ns, trace), columns.epoch, columns.last_seq, False, 0)]
        accepted = self._streams.accept(columns.stream_id, columns.epoch, columns.first_seq, columns.last_seq)
        fresh = columns.after(accepted.duplicates)
        run = Run(channel, fresh, wall_ns, trace)
        return [Arrived(run, columns.epoch, accepted.seq, True, accepted.duplicates, lane != BACKFILL)]

    def _on_metrics(self, lane: int, frame: link_pb2.AgentFrame, now_s: float, wall_ns: int) -> list[Event]:
        if self._lanes[lane].refusing:
            return []
        if self._meter is not None:
            wait_s = self._meter.take(frame.metrics.count, frame.metrics.ByteSize(), METRIC, now_s)
            if wait_s:
                return self._wait(lane, wait_s)
        columns = unpack_metrics(frame.metrics, limits=self._limits)
        numbers, index = distinct(columns.series_ids)
        series = self._series.together(tuple(numbers))
        accepted = self._streams.accept(columns.stream_id, columns.epoch, columns.first_seq, columns.last_seq)
        rows = Rows(series, index, columns.stamps_ns, columns.values).after(accepted.duplicates)
        return [
            RowsArrived(rows, columns.stream_id, columns.epoch, accepted.seq, accepted.duplicates, lane != BACKFILL)
        ]

    def _on_gap(self, lane: int, frame: link_pb2.AgentFrame, now_s: float, wall_ns: int) -> list[Event]:
        gap = frame.gap
        if self._lanes[lane].refusing:
            return []
        channel_id = gap.stream_id & CHANNEL_MASK
        if channel_id != METRIC_STREAM and channel_id not in self.channels:
            raise ProtocolError(f"stream {gap.stream_id} was not announced")
        declared = Gap(gap.from_seq, gap.to_seq, gap.reason[:64], gap.from_ns, gap.to_ns)
        events = self._skip(gap.stream_id, gap.epoch, declared)
        stored = self._streams.stored(gap.stream_id, gap.epoch)
        if not events and stored >= gap.to_seq:  # its acknowledgement was lost with an earlier session
            return self.committed([(gap.stream_id, gap.epoch, stored)])
        return events

    def _skip(self, stream_id: int, epoch: int, gap: Gap) -> list[Event]:
        fresh = self._streams.skip(stream_id, epoch, gap)
        return [] if fresh is None else [GapDeclared(stream_id, epoch, fresh)]

    def _on_resumed(self, lane: int, frame: link_pb2.AgentFrame, now_s: float, wall_ns: int) -> list[Event]:
        if frame.resumed.token == self._lanes[lane].refusing:
            self._lanes[lane].refusing = 0
        return []

    def _on_heartbeat(self, lane: int, frame: link_pb2.AgentFrame, now_s: float, wall_ns: int) -> list[Event]:
        beat = frame.heartbeat
        self._last_beat = (beat.sent_ns, now_s)
        sent_s = self._beats.pop(beat.echo_ns, None)
        if sent_s is None:
            return []
        return [Measured(max(0.0, now_s - sent_s - beat.held_ns / 1e9))]

    def _beat(self, now_s: float, wall_ns: int) -> list[Event]:
        self._beat_s = now_s
        beat = link_pb2.Heartbeat(sent_ns=wall_ns)
        if self._last_beat is not None:
            beat.echo_ns = self._last_beat[0]
            beat.held_ns = round((now_s - self._last_beat[1]) * 1e9)
        self._beats[wall_ns] = now_s
        while len(self._beats) > REMEMBERED_BEATS:
            del self._beats[next(iter(self._beats))]
        return [Send(CONTROL, link_pb2.GatewayFrame(heartbeat=beat))]


def meaning(channel: Channel) -> tuple[str, str, bool]:
    """What a channel's number stands for, once and for all."""
    return channel.topic, channel.schema_name, channel.history
