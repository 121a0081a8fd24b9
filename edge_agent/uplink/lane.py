"""One lane of the agent's session: what it announces, gathers from its logs, and holds back. Pure."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Final

from edge_agent.config.gateway_address import Compression
from edge_agent.forwarding.live_batch import sample_batches
from edge_agent.link.budget import Use
from edge_agent.outbox import Kind, Taken
from edge_agent.uplink.recording_upload import RecordingUpload
from edge_agent.uplink.window import Window
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import Limits
from metaros.link import batch_bytes, batches_frame, compress, metrics_frame, split_sample

if TYPE_CHECKING:
    from edge_agent.uplink.queues import Queues

__all__ = ["BACKFILL", "CONTROL", "DATA", "LANES", "LANE_LOGS", "LaneSender"]


CONTROL: Final = link_pb2.LANE_CONTROL
DATA: Final = link_pb2.LANE_DATA
BACKFILL: Final = link_pb2.LANE_BACKFILL
LANES: Final = (CONTROL, DATA, BACKFILL)
LANE_LOGS: Final = {CONTROL: ("event",), DATA: ("metric", "bulk"), BACKFILL: ("metric_backfill", "bulk_backfill")}
_USES: Final = {
    "event": Use.EVENT,
    "metric": Use.METRIC,
    "bulk": Use.BULK,
    "metric_backfill": Use.BACKFILL,
    "bulk_backfill": Use.BACKFILL,
}
FRAME_BYTES = 128 * 1024  # a frame gathers so much when there is a backlog; live samples go between two


class LaneSender:
    """What goes out on one lane. `queue` holds serialised AgentFrames."""

    def __init__(
        self, lane: link_pb2.Lane, queues: Queues, *, clock: Clock, limits: Limits, compression: Compression
    ) -> None:
        self.lane = lane
        self.queue: deque[bytes] = deque()
        self.window = Window()
        self.welcomed = False
        self._queues = queues
        self._clock = clock
        self._limits = limits
        self._compression = compression
        self._announced = 0
        self._paused: link_pb2.RetryLater | None = None
        self._resume_s = 0.0
        self._blocked: Use | None = None  # what the budget held back at the last gathering
        self._batches: list[bytes] = []
        self._batches_bytes = 0
        self.parts: RecordingUpload | None = None
        if lane == BACKFILL and queues.recordings is not None:
            self.parts = RecordingUpload(queues.recordings, queues.budget, limits=limits)
        self._parts_first = False

    def welcome(self, welcome: link_pb2.Welcome) -> None:
        """The gateway opened the lane."""
        self.welcomed = True
        self.window.max_bytes = welcome.window_bytes or self._limits.window_bytes
        self.window.max_batches = welcome.window_batches or self._limits.window_batches

    def put(self, frame: link_pb2.AgentFrame) -> None:
        """Queue a frame of the lane's own."""
        self.queue.append(frame.SerializeToString())

    def next(self) -> bytes | None:
        """The next frame to write."""
        if not self.queue:
            return None
        frame = self.queue.popleft()
        use = {CONTROL: Use.COMMAND, DATA: Use.LIVE, BACKFILL: Use.BACKFILL}[self.lane]
        self._queues.budget.spend(use, len(frame), self._clock.monotonic_s())
        return frame

    def announce(self) -> None:
        """Put what is new of channels and series in front."""
        channels = self._queues.channels
        if self._announced < channels.revision:
            frames = [
                link_pb2.AgentFrame(announce=announce).SerializeToString()
                for announce in channels.announcements(self._announced)
            ]
            self.queue.extendleft(reversed(frames))
            self._announced = channels.revision

    def pause(self, later: link_pb2.RetryLater, now_s: float) -> None:
        """The gateway cannot take durable frames of this lane now."""
        self._paused = later
        self._resume_s = now_s + later.retry_after_ms / 1000
        self.window.clear()

    def acknowledged(self, mark: link_pb2.Watermark, now_s: float) -> None:
        """A stream, perhaps of this lane, is stored up to a number."""
        freed = self.window.acknowledged(mark.epoch, mark.stream_id, mark.seq, now_s)
        if freed and self.lane == BACKFILL:
            self._queues.budget.backfilled(freed, now_s, delay_s=self.window.delay_s)

    def wait_s(self, now_s: float) -> float | None:
        """Seconds until there may be more by time alone: the end of a pause, the budget, the linger of live."""
        waits = []
        if self._paused is not None:
            waits.append(self._resume_s - now_s)
        if self._blocked is not None:
            waits.append(self._queues.budget.wait_s(self._blocked, now_s))
        if self.lane == DATA and (linger_s := self._queues.linger.wait_s(now_s)):
            waits.append(linger_s)
        return min(waits) if waits else None

    def gather(self) -> None:
        """Fill the queue with about FRAME_BYTES, as far as window and budget allow."""
        now_s = self._clock.monotonic_s()
        self._blocked = None
        if self._paused is not None and now_s >= self._resume_s:
            self._queues.outbox.restart(LANE_LOGS[self.lane])
            self.put(link_pb2.AgentFrame(resumed=link_pb2.Resumed(token=self._paused.token)))
            self._paused = None
        room, first, *rest = FRAME_BYTES, *LANE_LOGS[self.lane]
        self._parts_first = not self._parts_first  # in turns with what piled up
        if self._parts_first:
            self._part(0, now_s)
        room -= self._durable(first, room, now_s)
        if self.lane == DATA:
            room -= self._live(max(room, 1), now_s)
        for name in rest:
            room -= self._durable(name, max(room, 1), now_s)
        self._close_frame()
        if not self._parts_first:
            self._part(FRAME_BYTES - room, now_s)

    def _part(self, moved: int, now_s: float) -> None:
        """Offer new recordings, and send one part if the budget has room beyond what just moved."""
        if self.parts is None:
            return
        for offer in self.parts.offers():
            self.put(link_pb2.AgentFrame(recording=offer))
        if not self.parts.ready():
            return
        if self._queues.budget.room(Use.RECORDING, now_s) <= moved:
            self._blocked = Use.RECORDING
        elif (part := self.parts.next(now_s)) is not None:
            self.put(link_pb2.AgentFrame(recording=part))

    def _durable(self, name: str, room: int, now_s: float) -> int:
        """Move what fits from a log into the queue; bytes moved."""
        use, moved = _USES[name], 0
        if self._paused is not None:
            return 0
        while moved < room and self.window.open():
            if self._queues.budget.room(use, now_s) <= moved:
                self._blocked = use
                break
            taken = self._queues.outbox.take(name)
            if taken is None:
                break
            size = len(taken.frame.body)
            self._send(taken)
            epoch = self._queues.outbox.epoch_of(taken.era)
            self.window.sent(epoch, taken.frame.stream_id, taken.frame.last_seq, size, now_s)
            if self.lane == BACKFILL:
                self._queues.budget.backfill_taken(size, now_s)
            moved += size
        return moved

    def _send(self, taken: Taken) -> None:
        frame, epoch = taken.frame, self._queues.outbox.epoch_of(taken.era)
        numbers = {"stream_id": frame.stream_id, "epoch": epoch, "first_seq": frame.first_seq, "count": frame.count}
        if frame.kind is Kind.GAP:
            self._close_frame()
            gap = frame.gap()
            self.put(link_pb2.AgentFrame(gap=link_pb2.Gap(stream_id=frame.stream_id, epoch=epoch, **gap._asdict())))
        elif frame.kind is Kind.METRICS:
            self._close_frame()
            self.queue.append(metrics_frame(frame.body, **numbers))
        elif frame.count == 1 and len(frame.body) > self._limits.batch_bytes:
            self._send_large(link_pb2.Batch.FromString(frame.body), numbers)
        else:
            batch = batch_bytes(compress(frame.body, self._compression), **numbers)
            self._add(batch + self._trace(frame.stream_id, frame.first_seq, frame.body))

    def _send_large(self, batch: link_pb2.Batch, numbers: dict[str, int]) -> None:
        """A sample in pieces, each a frame of its own."""
        self._close_frame()
        stamp_ns = int.from_bytes(batch.stamps, "little", signed=True)
        for piece in split_sample(
            numbers["stream_id"], numbers["epoch"], numbers["first_seq"], stamp_ns, batch.payload, limits=self._limits
        ):
            self._add(self._traced(piece))
            self._close_frame()

    def _live(self, room: int, now_s: float) -> int:
        live, linger = self._queues.live, self._queues.linger
        if not live or linger.wait_s(now_s) != 0.0:
            return 0
        if (allowed := self._queues.budget.room(Use.LIVE, now_s)) <= 0:
            self._blocked = Use.LIVE
            return 0
        moved = 0
        for stream_id, samples in live.take(min(room, allowed)).items():
            for batch in sample_batches(stream_id, self._queues.outbox.live_epoch, samples, limits=self._limits):
                self._add(self._traced(batch))
                moved += len(batch.payload)
        if not live:
            linger.flushed()
        return moved

    def _traced(self, batch: link_pb2.Batch) -> bytes:
        """A live batch, or a piece of a large sample, with the times of a sample that is followed."""
        tracer, whole = self._queues.tracer, batch.SerializeToString()
        if tracer is None or batch.chunk_index + 1 < batch.chunk_count:
            return whole
        return whole + tracer.sent(batch.stream_id, batch.first_seq, batch.stamps)

    def _trace(self, stream_id: int, first_seq: int, body: bytes) -> bytes:
        """The same of the body of a durable batch, which is only read where a sample of it may be followed."""
        tracer = self._queues.tracer
        if tracer is None or not tracer.follows(stream_id):
            return b""
        return tracer.sent(stream_id, first_seq, link_pb2.Batch.FromString(body).stamps)

    def _add(self, batch: bytes) -> None:
        """Another batch for the frame that is being filled."""
        if self._batches and self._batches_bytes + len(batch) > FRAME_BYTES:
            self._close_frame()
        self._batches.append(batch)
        self._batches_bytes += len(batch)

    def _close_frame(self) -> None:
        if self._batches:
            self.queue.append(batches_frame(self._batches))
            self._batches, self._batches_bytes = [], 0
