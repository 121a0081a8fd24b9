"""The agent's half of a link session, sans I/O: gateway frames and the time in, agent frames and events out.

One object lives as long as one connection. A lane is open between its Welcome and its end; the shell opens control
first, then data, writes what `next_frame` gives, and asks again when woken or after `wait_s`. Whatever goes wrong is
raised (LinkError, FrameError); the shell then ends both lanes and makes a new session with a higher number.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field

from edge_agent.batch import Linger, metric_batch, sample_batches
from edge_agent.channels import METRIC_STREAM, Channels
from edge_agent.errors import LinkDeadError, RefusedError
from edge_agent.live import LiveQueue
from edge_agent.outbox import Gap, Outbox
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import FrameError
from metaros.limits import LIMITS, Limits
from metaros.link import ClockOffset

__all__ = ["CONTROL", "DATA", "AgentSession", "CommandArrived", "Established", "Event", "Identity", "TeleopArrived"]

PROTOCOL = 1
CONTROL = link_pb2.LANE_CONTROL
DATA = link_pb2.LANE_DATA
FRAME_BYTES = 256 * 1024  # a data frame gathers so much when there is a backlog
STATISTICS_S = 1.0
SILENT_BEATS = 3
LEAST_BEAT_S, MOST_BEAT_S = 0.2, 60.0  # whatever a gateway asks


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """Who the agent says it is."""

    robot_id: str
    session_id: bytes
    agent_version: str
    namespace: str
    hostname: str
    labels: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Established:
    """Both lanes are open."""

    gateway_id: str
    store_id: str


@dataclass(frozen=True, slots=True)
class CommandArrived:
    """A command, and when it came: its deadline counts from there."""

    command: link_pb2.Command
    arrived_s: float


@dataclass(frozen=True, slots=True)
class TeleopArrived:
    """A drive command with its age by the gateway's clock."""

    teleop: link_pb2.Teleop
    age_s: float


Event = Established | CommandArrived | TeleopArrived


@dataclass(slots=True)
class _Window:
    """What is sent and not acknowledged on the data lane."""

    max_bytes: int = 0
    max_batches: int = 0
    size_bytes: int = 0
    batches: int = 0
    flights: dict[int, deque[tuple[int, int]]] = field(default_factory=dict)  # stream -> (last seq, bytes)
    waiting_since_s: float = 0.0

    def open(self) -> bool:
        return self.batches < self.max_batches and self.size_bytes < self.max_bytes

    def sent(self, stream_id: int, last_seq: int, size_bytes: int, now_s: float) -> None:
        if self.batches == 0:
            self.waiting_since_s = now_s
        self.flights.setdefault(stream_id, deque()).append((last_seq, size_bytes))
        self.batches += 1
        self.size_bytes += size_bytes

    def acknowledged(self, stream_id: int, seq: int, now_s: float) -> None:
        flight = self.flights.get(stream_id, ())
        while flight and flight[0][0] <= seq:
            self.size_bytes -= flight.popleft()[1]
            self.batches -= 1
            self.waiting_since_s = now_s


class AgentSession:
    """One connection's state: lanes, announcements, window, heartbeats."""

    def __init__(
        self,
        identity: Identity,
        number: int,
        *,
        channels: Channels,
        outbox: Outbox,
        live: LiveQueue,
        linger: Linger,
        clock: Clock,
        limits: Limits = LIMITS,
        store_id: str = "",
        malformed: Callable[[], int] = int,
    ) -> None:
        self.number = number
        self.store_id = store_id
        self.gateway_id = ""
        self.offset = ClockOffset(clock)
        self.malformed: Callable[[], int] = malformed
        self._identity = identity
        self._channels = channels
        self._outbox = outbox
        self._live = live
        self._linger = linger
        self._clock = clock
        self._limits = limits
        self._announced: dict[int, int] = {}  # lane -> revision; a lane is open when it has an entry
        self._control: deque[link_pb2.AgentFrame] = deque()
        self._data: deque[link_pb2.AgentFrame] = deque()
        self._window = _Window()
        self._heartbeat_s = limits.heartbeat_s
        self._next_statistics_s = self._heard_s = clock.monotonic_s()
        self._next_beat_s = {CONTROL: self._heard_s, DATA: self._heard_s}

    @property
    def established(self) -> bool:
        """Whether both lanes are open."""
        return CONTROL in self._announced and DATA in self._announced

    def hello(self, lane: link_pb2.Lane) -> link_pb2.AgentFrame:
        """The first frame of a lane."""
        who = self._identity
        streams = self._outbox.ranges() if lane == DATA else []
        epoch = self._outbox.epoch
        hello = link_pb2.Hello(
            protocol=PROTOCOL,
            robot_id=who.robot_id,
            session_id=who.session_id,
            session_number=self.number,
            lane=lane,
            agent_version=who.agent_version,
            namespace=who.namespace,
            hostname=who.hostname,
            labels=who.labels,
            streams=[
                link_pb2.StreamState(stream_id=s.stream_id, epoch=epoch, first_seq=s.first_seq, last_seq=s.last_seq)
                for s in streams
            ],
        )
        return link_pb2.AgentFrame(hello=hello)

    def receive(self, lane: link_pb2.Lane, frame: link_pb2.GatewayFrame) -> list[Event]:
        """Take in a frame of the gateway.

        Raises:
            RefusedError: the gateway said goodbye, or has another store.
            FrameError: the frame breaks the protocol.
        """
        self._heard_s = self._clock.monotonic_s()
        match frame.WhichOneof("frame"):
            case "goodbye":
                bye = frame.goodbye
                raise RefusedError(bye.code, bye.message, retry_after_s=bye.retry_after_ms / 1000)
            case "welcome":
                return self._welcomed(lane, frame.welcome)
            case "ack" if DATA in self._announced:
                self._acknowledged(frame.ack)
            case "heartbeat":
                beat = frame.heartbeat
                self.offset.received(beat.sent_ns, beat.echo_ns, beat.held_ns)
                if beat.echo_ns == 0:  # the peer has no round trip yet: let it have one now
                    self._next_beat_s[lane] = self._heard_s
            case "demand":
                entries = frame.demand.entries
                self._channels.demand({entry.channel_id: entry.max_rate_hz for entry in entries})
            case "command":
                return [CommandArrived(frame.command, self._heard_s)]
            case "teleop":
                self.offset.saw(frame.teleop.sent_ns)
                return [TeleopArrived(frame.teleop, self.offset.age_s(frame.teleop.sent_ns) or 0.0)]
            case other:
                raise FrameError(f"unexpected frame {other} on lane {lane}")
        return []

    def check(self) -> None:
        """Raise LinkDeadError when the gateway was silent, or acknowledged nothing, for too long."""
        now_s, limit_s = self._clock.monotonic_s(), SILENT_BEATS * self._heartbeat_s
        if now_s - self._heard_s > limit_s:
            raise LinkDeadError(f"nothing heard from the gateway for {limit_s:g} s")
        if self._window.batches and now_s - self._window.waiting_since_s > limit_s:
            raise LinkDeadError(f"no acknowledgement from the gateway for {limit_s:g} s")

    def answer(self, result: link_pb2.CommandResult) -> None:
        """Queue a command's result."""
        self._control.append(link_pb2.AgentFrame(result=result))

    def next_frame(self, lane: link_pb2.Lane) -> link_pb2.AgentFrame | None:
        """What to write on the lane now, None when there is nothing yet."""
        if lane not in self._announced:
            return None
        queue = self._control if lane == CONTROL else self._data
        if self._announced[lane] < self._channels.revision:
            announces = list(self._channels.announcements(self._announced[lane]))
            self._announced[lane] = self._channels.revision
            queue.extendleft(link_pb2.AgentFrame(announce=announce) for announce in reversed(announces))
        if not queue:
            self._beat(lane, queue)
            if lane == CONTROL:
                self._statistics()
            elif self._linger.wait_s(self._clock.monotonic_s()) == 0.0:
                self._gather()
        return queue.popleft() if queue else None

    def wait_s(self, lane: link_pb2.Lane) -> float | None:
        """Seconds until `next_frame` may have something by time alone; None = not before somebody wakes the lane."""
        if lane not in self._announced:
            return None
        now_s = self._clock.monotonic_s()
        beat_s = max(0.0, self._next_beat_s[lane] - now_s)
        if lane == CONTROL:
            return min(beat_s, max(0.0, self._next_statistics_s - now_s))
        wait_s = self._linger.wait_s(now_s)
        return min(beat_s, wait_s) if wait_s else beat_s  # 0.0, yet nothing given: the window is full, an ack wakes us

    def _welcomed(self, lane: link_pb2.Lane, welcome: link_pb2.Welcome) -> list[Event]:
        if lane in self._announced:
            raise FrameError("a second Welcome on one lane")
        if self.store_id and welcome.store_id != self.store_id:
            raise RefusedError("other_store", f"its store is {welcome.store_id}, ours was {self.store_id}")
        self.gateway_id, self.store_id = welcome.gateway_id, welcome.store_id
        if welcome.heartbeat_s > 0:
            self._heartbeat_s = min(max(welcome.heartbeat_s, LEAST_BEAT_S), MOST_BEAT_S)
        if lane == DATA:
            self._window.max_bytes = welcome.window_bytes or self._limits.window_bytes
            self._window.max_batches = welcome.window_batches or self._limits.window_batches
            epoch = self._outbox.epoch
            self._outbox.resume({mark.stream_id: mark.seq for mark in welcome.watermarks if mark.epoch == epoch})
            self._linger.add(0, self._clock.monotonic_s() - self._limits.linger_s)
        self._announced[lane] = 0
        return [Established(self.gateway_id, self.store_id)] if self.established else []

    def _acknowledged(self, ack: link_pb2.Ack) -> None:
        for mark in ack.watermarks:
            self._outbox.acknowledge(mark.stream_id, mark.epoch, mark.seq)
            self._window.acknowledged(mark.stream_id, mark.seq, self._heard_s)

    def _beat(self, lane: link_pb2.Lane, queue: deque[link_pb2.AgentFrame]) -> None:
        now_s = self._clock.monotonic_s()
        if now_s >= self._next_beat_s[lane]:
            beat = self.offset.beat()
            frame = link_pb2.Heartbeat(sent_ns=beat.sent_ns, echo_ns=beat.echo_ns, held_ns=beat.held_ns)
            queue.append(link_pb2.AgentFrame(heartbeat=frame))
            self._next_beat_s[lane] = now_s + self._heartbeat_s

    def _statistics(self) -> None:
        now_s = self._clock.monotonic_s()
        if now_s >= self._next_statistics_s:
            statistics = link_pb2.TopicStatistics(
                topics=[channel.rate(now_s) for channel in self._channels],
                outbox_bytes=self._outbox.size_bytes,
                outbox_samples=self._outbox.sample_count,
                malformed=self.malformed(),
            )
            self._control.append(link_pb2.AgentFrame(statistics=statistics))
            self._next_statistics_s = now_s + STATISTICS_S

    def _gather(self) -> None:
        """Fill the data queue from outbox and live queue: events, metrics, live, bulk; about FRAME_BYTES in all."""
        batches: list[link_pb2.Batch] = []
        room = FRAME_BYTES - self._durable("event", batches, FRAME_BYTES)
        self._metrics()
        for stream_id, samples in self._live.take(max(room, 1)).items():
            for batch in sample_batches(stream_id, self._outbox.epoch, samples, limits=self._limits):
                batches.append(batch)
                room -= len(batch.payload)
        self._durable("bulk", batches, max(room, 1))
        self._frame(batches)
        if not self._live and not any(self._waiting()):
            self._linger.flushed()

    def _waiting(self) -> list[int]:
        return [stream for name in ("event", "metric", "bulk") for stream in self._outbox.waiting(name)]

    def _durable(self, delivery: str, batches: list[link_pb2.Batch], room: int) -> int:
        """Move what fits from the class's streams into `batches`; Gaps go out in their place. Bytes moved."""
        moved = 0
        for stream_id in list(self._outbox.waiting(delivery)):
            while moved < room and self._window.open():
                run = self._outbox.take(
                    stream_id,
                    max_bytes=min(room - moved, self._limits.batch_bytes),
                    max_samples=self._limits.batch_samples,
                )
                if run is None:
                    break
                if isinstance(run, Gap):
                    self._frame(batches)
                    self._gap(stream_id, run)
                    continue
                for batch in sample_batches(stream_id, self._outbox.epoch, run, limits=self._limits):
                    batches.append(batch)
                    moved += len(batch.payload)
                size = sum(len(sample.data) for sample in run)
                self._window.sent(stream_id, run[-1].seq, size, self._clock.monotonic_s())
        return moved

    def _metrics(self) -> None:
        while self._window.open() and any(True for _ in self._outbox.waiting("metric")):
            run = self._outbox.take(METRIC_STREAM, max_bytes=FRAME_BYTES, max_samples=self._limits.batch_samples)
            if isinstance(run, Gap):
                self._gap(METRIC_STREAM, run)
            elif run:
                self._data.append(link_pb2.AgentFrame(metrics=metric_batch(self._outbox.epoch, run)))
                self._window.sent(METRIC_STREAM, run[-1].seq, 20 * len(run), self._clock.monotonic_s())

    def _gap(self, stream_id: int, gap: Gap) -> None:
        frame = link_pb2.Gap(stream_id=stream_id, epoch=self._outbox.epoch, **gap._asdict())
        self._data.append(link_pb2.AgentFrame(gap=frame))

    def _frame(self, batches: list[link_pb2.Batch]) -> None:
        """Queue what was gathered as frames within the wire's limit, and empty the list."""
        frame, size = link_pb2.Batches(), 0
        for batch in batches:
            if size and size + len(batch.payload) > FRAME_BYTES:
                self._data.append(link_pb2.AgentFrame(batches=frame))
                frame, size = link_pb2.Batches(), 0
            frame.batches.append(batch)
            size += len(batch.payload) + 1
        if size:
            self._data.append(link_pb2.AgentFrame(batches=frame))
        batches.clear()
