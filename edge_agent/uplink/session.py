"""The agent's half of a link session, sans I/O: gateway frames and the time in, agent frames and events out.

One object lives as long as one connection of three lanes. The shell opens control, data and back-fill, writes what
`next_frame` gives, and asks again when woken or after `wait_s`. Once all three are welcomed the outbox is put back to
the gateway's watermarks, and everything flows. Whatever goes wrong is raised (LinkError, FrameError); the shell then
ends all lanes and makes a new session with a higher number.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from dataclasses import dataclass, field

from edge_agent.config.gateway_address import Compression
from edge_agent.errors import LinkDeadError, RefusedError, UnprovenError
from edge_agent.identity.credentials import Credentials
from edge_agent.link.frames import CommandArrived, ControlFrame, TeleopArrived
from edge_agent.link.handler import CONTROL_FRAMES
from edge_agent.uplink.lane import BACKFILL, CONTROL, DATA, LANE_LOGS, LANES, LaneSender
from edge_agent.uplink.queues import Queues
from edge_agent.uplink.statistics import LinkFacts, statistics, steady_part
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.errors import FrameError
from metaros.limits import LIMITS, Limits
from metaros.link import ClockOffset

__all__ = [
    "BACKFILL",
    "CONTROL",
    "DATA",
    "LANES",
    "AgentSession",
    "Established",
    "Event",
    "Identity",
]

LOG = logging.getLogger("metaros.agent.uplink")
PROTOCOL = 1
STATISTICS_S = 1.0
QUIET_STATISTICS_S = 15.0  # while they say nothing new: most robots of a large fleet stand still
SIDE_BEATS = 4  # beats of control for one of another lane: it is enough to keep proxies' tables; TCP is asked anyway
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
    """All lanes are open, and the outbox stands at the gateway's watermarks."""

    gateway_id: str
    store_id: str
    welcome: link_pb2.Welcome = field(default_factory=link_pb2.Welcome, compare=False)  # of the control lane


Event = Established | CommandArrived | TeleopArrived | ControlFrame


class AgentSession:
    """One connection's state: lanes, watermarks, heartbeats."""

    def __init__(
        self,
        identity: Identity,
        number: int,
        queues: Queues,
        *,
        clock: Clock,
        limits: Limits = LIMITS,
        store_id: str = "",
        compression: Compression = "none",
        malformed: Callable[[], int] = int,
        facts: LinkFacts | None = None,
        credentials: Credentials | None = None,
    ) -> None:
        self._credentials = credentials
        self.number = number
        self.store_id = store_id
        self.gateway_id = ""
        self.offset = ClockOffset(clock)
        if queues.tracer is not None:
            queues.tracer.clock_offset_ns = self.offset.offset_ns
        self._identity = identity
        self._queues = queues
        self._clock = clock
        self._malformed = malformed
        self._facts = facts if facts is not None else LinkFacts()
        self._lanes = {
            lane: LaneSender(lane, queues, clock=clock, limits=limits, compression=compression) for lane in LANES
        }
        self._marks: dict[tuple[int, int], int] = {}
        self._control_welcome = link_pb2.Welcome()
        self._stored_writers: dict[int, str] = {}
        self._heartbeat_s = limits.heartbeat_s
        self._next_statistics_s = self._received_s = clock.monotonic_s()
        self._next_beat_s = dict.fromkeys(LANES, self._received_s)
        self._reported = link_pb2.TopicStatistics()  # the last statistics, without what never stands still
        self._reported_s = -math.inf

    @property
    def established(self) -> bool:
        """Whether all lanes are open."""
        return all(lane.welcomed for lane in self._lanes.values())

    def hello(self, lane: link_pb2.Lane) -> link_pb2.AgentFrame:
        """The first frame of a lane."""
        who, outbox = self._identity, self._queues.outbox
        held = outbox.ranges(LANE_LOGS[lane])
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
            streams=[link_pb2.StreamState(**stream._asdict()) for stream in held],
            writers=outbox.state.writers,
            epochs=outbox.state.epochs.values(),
            certificates=self._credentials.certificates() if self._credentials is not None else (),
        )
        return link_pb2.AgentFrame(hello=hello)

    def prove(self, hello: link_pb2.AgentFrame, challenge: link_pb2.Challenge) -> link_pb2.AgentFrame:
        """The answer to a challenge that came instead of a Welcome. Raises UnprovenError."""
        if self._credentials is None:
            raise UnprovenError("the gateway asks who this robot is, and it was never enrolled: metaros agent enrol")
        return link_pb2.AgentFrame(proof=self._credentials.prove(hello.hello, challenge))

    def receive(self, lane: link_pb2.Lane, frame: link_pb2.GatewayFrame) -> list[Event]:
        """Take in a frame of the gateway.

        Raises:
            RefusedError: the gateway said goodbye, or has another store.
            BehindError: the gateway has more than the outbox ever accepted.
            FrameError: the frame breaks the protocol.
        """
        self._received_s = self._clock.monotonic_s()
        sender = self._lanes[lane]
        match frame.WhichOneof("frame"):
            case "goodbye":
                bye = frame.goodbye
                raise RefusedError(bye.code, bye.message, retry_after_s=bye.retry_after_ms / 1000)
            case "welcome":
                return self._welcomed(sender, frame.welcome)
            case "ack":
                if self.established:  # else it is of an earlier session, and the marks will say so
                    self._acknowledged(frame.ack)
            case "recording_wanted":
                if sender.parts is not None:
                    sender.parts.wanted(frame.recording_wanted, self._received_s)
            case "retry_later" if sender.welcomed:
                sender.pause(frame.retry_later, self._received_s)
            case "heartbeat":
                beat = frame.heartbeat
                self.offset.received(beat.sent_ns, beat.echo_ns, beat.held_ns)
                if beat.echo_ns == 0:  # the peer has no round trip yet: let it have one now
                    self._next_beat_s[lane] = self._received_s
            case "demand":
                entries = frame.demand.entries
                self._queues.channels.demand({entry.channel_id: entry.max_rate_hz for entry in entries})
                return [ControlFrame(frame, self._received_s)]
            case "command":
                if frame.command.sent_ns:
                    self.offset.saw(frame.command.sent_ns)
                return [CommandArrived(frame.command, self._received_s, self.offset.peer_now_ns())]
            case "teleop":
                self.offset.saw(frame.teleop.sent_ns)
                return [TeleopArrived(frame.teleop, self.offset.age_s(frame.teleop.sent_ns) or 0.0)]
            case "talk":
                self.offset.saw(frame.talk.sent_ns)
                return [TeleopArrived(frame.talk, self.offset.age_s(frame.talk.sent_ns) or 0.0)]
            case str() as kind if kind in CONTROL_FRAMES:
                return [ControlFrame(frame, self._received_s)]
            case None:
                LOG.debug("a frame that this agent does not know")  # of a newer gateway
            case other:
                raise FrameError(f"unexpected frame {other} on lane {lane}")
        return []

    def check(self) -> None:
        """Raise LinkDeadError when the gateway was silent, or acknowledged nothing, for too long."""
        now_s, limit_s = self._clock.monotonic_s(), SILENT_BEATS * self._heartbeat_s
        if now_s - self._received_s > limit_s:
            raise LinkDeadError(f"nothing received from the gateway for {limit_s:g} s")
        for lane in self._lanes.values():
            if lane.window.batches and now_s - lane.window.waiting_since_s > limit_s:
                raise LinkDeadError(f"no acknowledgement from the gateway for {limit_s:g} s")

    def answer(self, result: link_pb2.CommandResult) -> None:
        """Queue a command's result."""
        self._lanes[CONTROL].put(link_pb2.AgentFrame(result=result))

    def send_frame(self, frame: link_pb2.AgentFrame) -> None:
        """Queue a handler's frame on the control lane."""
        self._lanes[CONTROL].put(frame)

    def next_frame(self, lane: link_pb2.Lane) -> bytes | None:
        """What to write on the lane now, a serialised AgentFrame; None when there is nothing yet."""
        sender = self._lanes[lane]
        if not sender.welcomed:
            return None
        sender.announce()
        if not sender.queue:
            self._beat(lane, sender)
            if lane == CONTROL:
                self._statistics(sender)
            if self.established:
                sender.gather()
        return sender.next()

    def wait_s(self, lane: link_pb2.Lane) -> float | None:
        """Seconds until `next_frame` may have something by time alone; None = not before somebody wakes the lane."""
        sender = self._lanes[lane]
        if not sender.welcomed:
            return None
        now_s = self._clock.monotonic_s()
        waits = [self._next_beat_s[lane] - now_s]
        if lane == CONTROL:
            waits.append(self._next_statistics_s - now_s)
        if self.established and (wait_s := sender.wait_s(now_s)) is not None:
            waits.append(wait_s)
        return max(0.0, min(waits))

    def _welcomed(self, sender: LaneSender, welcome: link_pb2.Welcome) -> list[Event]:
        if sender.welcomed:
            raise FrameError("a second Welcome on one lane")
        if self.store_id and welcome.store_id != self.store_id:
            raise RefusedError("other_store", f"its store is {welcome.store_id}, ours was {self.store_id}")
        if self.gateway_id and welcome.gateway_id != self.gateway_id:
            text = f"its lanes reached the gateways {self.gateway_id} and {welcome.gateway_id}: a load balancer between"
            raise RefusedError("split", f"{text} needs to send all of one client's connections to one")
        self.gateway_id, self.store_id = welcome.gateway_id, welcome.store_id
        if welcome.heartbeat_s > 0:
            self._heartbeat_s = min(max(welcome.heartbeat_s, LEAST_BEAT_S), MOST_BEAT_S)
        sender.welcome(welcome)
        if sender.lane == CONTROL:
            self._control_welcome = welcome
        self._marks.update({(mark.epoch, mark.stream_id): mark.seq for mark in welcome.watermarks})
        self._stored_writers.update({known.epoch: known.writer for known in welcome.stored_writers})
        if not self.established:
            return []
        self._queues.outbox.resume(self._marks, self._stored_writers)
        self._queues.outbox.writers_stored(self._stored_writers.values())
        return [Established(self.gateway_id, self.store_id, self._control_welcome)]

    def _acknowledged(self, ack: link_pb2.Ack) -> None:
        for mark in ack.watermarks:
            self._queues.outbox.acknowledge(mark.stream_id, mark.epoch, mark.seq)
            for lane in self._lanes.values():
                lane.acknowledged(mark, self._received_s)

    def _beat(self, lane: link_pb2.Lane, sender: LaneSender) -> None:
        now_s = self._clock.monotonic_s()
        if now_s >= self._next_beat_s[lane]:
            beat = self.offset.beat()
            frame = link_pb2.Heartbeat(sent_ns=beat.sent_ns, echo_ns=beat.echo_ns, held_ns=beat.held_ns)
            sender.put(link_pb2.AgentFrame(heartbeat=frame))
            self._next_beat_s[lane] = now_s + self._heartbeat_s * (1 if lane == CONTROL else SIDE_BEATS)

    def _statistics(self, sender: LaneSender) -> None:
        now_s = self._clock.monotonic_s()
        if now_s >= self._next_statistics_s:
            update = statistics(self._queues, self._facts, self.offset, now_s=now_s, malformed=self._malformed())
            self._next_statistics_s = now_s + STATISTICS_S
            if (news := steady_part(update)) != self._reported or now_s - self._reported_s >= QUIET_STATISTICS_S:
                sender.put(link_pb2.AgentFrame(statistics=update))
                self._reported, self._reported_s = news, now_s
