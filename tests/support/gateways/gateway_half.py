"""A minimal gateway side of the link, in memory: stores frames, and fails the test where the contract breaks."""

from __future__ import annotations

from collections import defaultdict

from metaros._proto import link_pb2
from metaros.link import BACKFILL_BIT, CHANNEL_MASK, Reassembler, decompress, unpack_metrics

__all__ = ["BACKFILL", "CONTROL", "DATA", "LANES", "GatewayHalf", "late_stream"]

CONTROL, DATA, BACKFILL = link_pb2.LANE_CONTROL, link_pb2.LANE_DATA, link_pb2.LANE_BACKFILL
LANES = (CONTROL, DATA, BACKFILL)


class GatewayHalf:
    """Outlives sessions; `connect` starts one. Frames to the agent gather in `out[lane]`.

    `rows` and `gaps` are by stream: what was accepted while the link was down has the stream `late_stream(channel)`.
    """

    def __init__(self, *, store_id: str = "store", window_bytes: int = 0, window_batches: int = 0) -> None:
        self.welcome = link_pb2.Welcome(
            gateway_id="gw",
            store_id=store_id,
            window_bytes=window_bytes,
            window_batches=window_batches,
            heartbeat_s=5.0,
        )
        self.channels: dict[int, link_pb2.Channel] = {}
        self.series: dict[int, link_pb2.Series] = {}
        self.watermarks: dict[tuple[int, int], int] = {}
        self.writers: dict[int, str] = {}
        self.rows: dict[int, dict[int, object]] = defaultdict(dict)
        self.gaps: dict[int, dict[int, str]] = defaultdict(dict)
        self.live: dict[int, list[tuple[int, bytes]]] = defaultdict(list)
        self.duplicates = 0
        self.dropped = 0  # durable frames that came while their lane was refused
        self.refusing: dict[int, int] = {}
        self.hellos: list[link_pb2.Hello] = []
        self.results: list[link_pb2.CommandResult] = []
        self.statistics: list[link_pb2.TopicStatistics] = []
        self.heartbeats: list[tuple[int, link_pb2.Heartbeat]] = []
        self.offers: list[link_pb2.RecordingPart] = []
        self.parts: list[link_pb2.RecordingPart] = []
        self.twins: list[link_pb2.TwinReport] = []
        self.frames = 0
        self.connect()

    def connect(self) -> None:
        """A new session begins; what was on its way is lost."""
        self.out: dict[int, list[link_pb2.GatewayFrame]] = {lane: [] for lane in LANES}
        self.unacked: dict[tuple[int, int], int] = {}
        self.reassemblers = {lane: Reassembler() for lane in LANES}
        self.announced: dict[int, set[int]] = {lane: set() for lane in LANES}
        self.refusing.clear()

    def refuse(self, lane: int, token: int, *, retry_after_ms: int = 100) -> None:
        """Durable frames of a lane are dropped until its `Resumed` comes."""
        self.refusing[lane] = token
        later = link_pb2.RetryLater(token=token, retry_after_ms=retry_after_ms, reason="store_full")
        self.out[lane].append(link_pb2.GatewayFrame(retry_later=later))

    def all_rows(self, channel_id: int) -> list[object]:
        """A channel's samples: those of a time without a link first, in order."""
        late, fresh = self.rows[late_stream(channel_id)], self.rows[channel_id]
        return [row for rows in (late, fresh) for _, row in sorted(rows.items())]

    def receive(self, lane: int, frame: link_pb2.AgentFrame) -> None:
        """One frame of the agent."""
        self.frames += 1
        kind = frame.WhichOneof("frame")
        assert kind is not None
        getattr(self, f"on_{kind}")(lane, getattr(frame, kind))

    def on_hello(self, lane: int, hello: link_pb2.Hello) -> None:
        assert (hello.protocol, hello.lane) == (1, lane)
        self.hellos.append(hello)
        welcome = link_pb2.Welcome()
        welcome.CopyFrom(self.welcome)
        for state in hello.streams:
            key = (state.stream_id, state.epoch)
            self.watermarks.setdefault(key, state.base_seq)
            if hello.writers:
                self.writers[state.epoch] = hello.writers[-1]
            seq = self.watermarks[key]
            welcome.watermarks.append(link_pb2.Watermark(stream_id=state.stream_id, epoch=state.epoch, seq=seq))
        for epoch in {s.epoch for s in hello.streams if s.epoch in self.writers}:
            welcome.stored_writers.add(epoch=epoch, writer=self.writers[epoch])
        self.out[lane].append(link_pb2.GatewayFrame(welcome=welcome))

    def on_announce(self, lane: int, announce: link_pb2.Announce) -> None:
        for channel in announce.channels:
            self.channels[channel.channel_id] = channel
            self.announced[lane].add(channel.channel_id)
        for series in announce.series:
            self.series[series.series_id] = series

    def on_batches(self, lane: int, batches: link_pb2.Batches) -> None:
        for batch in batches.batches:
            channel_id = batch.stream_id & CHANNEL_MASK
            assert channel_id in self.announced[lane], "a batch before its announcement"
            delivery = getattr(self.channels[channel_id], "class")
            live = delivery == link_pb2.DELIVERY_CLASS_LIVE
            if not live:
                self.on_its_lane(lane, batch.stream_id, event=delivery == link_pb2.DELIVERY_CLASS_EVENT)
            if lane in self.refusing and not live:
                self.dropped += 1
                continue
            columns = self.reassemblers[lane].feed(decompress(batch))
            if columns is None:
                continue
            if live:
                assert lane == DATA
                self.live[batch.stream_id] += [(seq, bytes(data)) for seq, _, data in columns.samples()]
                continue
            for seq, _stamp, data in columns.samples():
                self.store(batch.stream_id, batch.epoch, seq, bytes(data))

    def on_metrics(self, lane: int, batch: link_pb2.MetricBatch) -> None:
        self.on_its_lane(lane, batch.stream_id)
        if lane in self.refusing:
            self.dropped += 1
            return
        columns = unpack_metrics(batch)
        rows = zip(columns.series_ids.tolist(), columns.stamps_ns.tolist(), columns.values.tolist(), strict=True)
        for offset, row in enumerate(rows):
            assert row[0] in self.series, "a row before its series"
            self.store(batch.stream_id, columns.epoch, columns.first_seq + offset, row)

    def on_gap(self, lane: int, gap: link_pb2.Gap) -> None:
        if lane in self.refusing:
            self.dropped += 1
            return
        watermark = self.watermarks.get((gap.stream_id, gap.epoch), 0)
        assert gap.from_seq <= watermark + 1, f"gap from {gap.from_seq} after {watermark}"
        for seq in range(watermark + 1, gap.to_seq + 1):
            self.gaps[gap.stream_id][seq] = gap.reason
        self.advance(gap.stream_id, gap.epoch, max(gap.to_seq, watermark))

    def on_statistics(self, lane: int, statistics: link_pb2.TopicStatistics) -> None:
        assert lane == CONTROL
        self.statistics.append(statistics)

    def on_twin(self, lane: int, report: link_pb2.TwinReport) -> None:
        assert lane == CONTROL
        assert self.welcome.twin, "a report to a gateway that does not know twins"
        self.twins.append(report)

    def on_result(self, lane: int, result: link_pb2.CommandResult) -> None:
        assert lane == CONTROL
        self.results.append(result)

    def on_heartbeat(self, lane: int, heartbeat: link_pb2.Heartbeat) -> None:
        self.heartbeats.append((lane, heartbeat))

    def on_recording(self, lane: int, part: link_pb2.RecordingPart) -> None:
        assert lane == BACKFILL
        assert len(part.data) <= 256 * 1024
        (self.parts if part.data else self.offers).append(part)

    def on_resumed(self, lane: int, resumed: link_pb2.Resumed) -> None:
        if self.refusing.get(lane) == resumed.token:
            del self.refusing[lane]

    def on_its_lane(self, lane: int, stream_id: int, *, event: bool = False) -> None:
        """Fail where a stream is on a lane that is not its own."""
        late = bool(stream_id & BACKFILL_BIT)
        assert lane == (CONTROL if event else BACKFILL if late else DATA), f"stream {stream_id} on lane {lane}"

    def store(self, stream_id: int, epoch: int, seq: int, row: object) -> None:
        """One sample of a durable class: a duplicate, or the next."""
        watermark = self.watermarks.get((stream_id, epoch), 0)
        if seq <= watermark:
            self.duplicates += 1
            return
        assert seq == watermark + 1, f"stream {stream_id}: {seq} after {watermark} without a gap"
        self.rows[stream_id][seq] = row
        self.advance(stream_id, epoch, seq)

    def advance(self, stream_id: int, epoch: int, seq: int) -> None:
        """Move a stream's watermark; it is acknowledged by the next `ack`."""
        self.watermarks[stream_id, epoch] = seq
        self.unacked[stream_id, epoch] = seq

    def ack(self) -> None:
        """Acknowledge everything stored."""
        if self.unacked:
            marks = [link_pb2.Watermark(stream_id=s, epoch=e, seq=q) for (s, e), q in self.unacked.items()]
            self.out[DATA].append(link_pb2.GatewayFrame(ack=link_pb2.Ack(watermarks=marks)))
            self.unacked.clear()


def late_stream(channel_id: int) -> int:
    """The stream of what a channel, or the metrics (0), accepted while the link was down."""
    return channel_id | BACKFILL_BIT
