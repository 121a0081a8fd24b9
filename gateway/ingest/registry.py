"""What the gateway knows about every robot: state, channels, counts, newest values. Lives on the event loop."""

from __future__ import annotations

import asyncio
import math
from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from gateway.domain.channel import METRIC_STREAM, Channel, Series
from gateway.domain.robot import Robot
from gateway.domain.sample import Gap, Rows, Run
from gateway.errors import UnknownRobotError
from gateway.ingest.quota import Meter
from gateway.ingest.streams import StreamTable
from metaros._proto import link_pb2
from metaros.limits import LIMITS
from metaros.link import CHANNEL_MASK

__all__ = ["ChannelState", "Counts", "RateMeter", "Registry", "RobotRecord", "SeriesState"]

HEADLINE_SERIES = 64
REMEMBERED_PROCESSES = 16  # agents of one robot, one after another
REMEMBERED_SERIES = 4 * LIMITS.series_per_robot  # of one robot's agents, one after another
RIVAL_TRIES = 3
LONGEST_LAG_NS = 2**63 - 1  # other gateways are told no longer one; of a clock at the beginning of all stamps it is


class RateMeter:
    """A rate over the last couple of seconds, by exponential forgetting; pure."""

    def __init__(self, *, span_s: float = 2.0) -> None:
        self._span_s = span_s
        self._rate = 0.0
        self._at_s: float | None = None

    def add(self, amount: float, now_s: float) -> None:
        """Count `amount` in."""
        self._rate = self.read(now_s) + amount / self._span_s

    def read(self, now_s: float) -> float:
        """The rate a second, now."""
        if self._at_s is not None and now_s > self._at_s:
            self._rate *= math.exp((self._at_s - now_s) / self._span_s)
        self._at_s = now_s
        return self._rate

    def set(self, rate: float, now_s: float) -> None:
        """Somebody else counts: this is the rate a second, now."""
        self._rate, self._at_s = rate, now_s


@dataclass(slots=True)
class ChannelState:
    """One channel and what came of it."""

    channel: Channel
    received: int = 0
    received_bytes: int = 0
    lost: int = 0
    last_stamp_ns: int | None = None
    rate: link_pb2.TopicRate = field(default_factory=link_pb2.TopicRate)


@dataclass(slots=True)
class SeriesState:
    """One series and its newest row."""

    series: Series
    samples: int = 0
    stamp_ns: int | None = None
    value: float | None = None


@dataclass(slots=True)
class Counts:
    """What arrived from a robot since this gateway started."""

    samples: int = 0
    bytes: int = 0
    duplicates: int = 0
    gaps: int = 0
    lost: int = 0
    over_quota: int = 0  # live samples dropped because the robot sends more than it may
    put_off: int = 0  # how often a lane was told to send durable frames later for that


class RobotRecord:
    """Everything known about one robot. `revision` grows with every visible change.

    A robot is linked `here`, to this very gateway, or to another one of the same store, its `owner_gateway`; `online`
    is either.
    What is known of a robot that is linked elsewhere is what its owner reports.
    """

    def __init__(self, robot: Robot, *, seen_ns: int, streams: StreamTable | None = None) -> None:
        self.robot = robot
        self.streams = streams
        self.online = False
        self.here = False
        self.owner_gateway = ""  # the gateway where it is linked; "": here, or nowhere
        self.owner_session = 0  # the number of its session there
        self.generation = 0  # grows with each process whose channels it has
        self.owner_counts: Counts | None = (
            None  # what its owner counted, where the newest that is known came from there
        )
        self.owner_epochs = 0
        self.since_ns = seen_ns
        self.last_seen_ns = seen_ns
        self.session_number = 0
        self.rtt_s: float | None = None
        self.lag_ns: int | None = None  # how old the newest sample was when it came, each by its own clock
        self.statistics = link_pb2.TopicStatistics()
        self.counts = Counts()
        self.channels: dict[int, ChannelState] = {}
        self.series: dict[str, SeriesState] = {}
        self.byte_rate = RateMeter()
        self.meter: Meter | None = None
        self.joining = asyncio.Lock()  # one lane after another is opened; no robot waits for another one's
        self.quota_said_s = -math.inf
        self.forks = 0  # how often a copy of the robot's outbox was found out
        self.revision = 1
        self.on_other: Callable[[], None] = lambda: None  # it is another robot than it was, by its own words
        self._process = b""
        self._displaced: deque[bytes] = deque(maxlen=REMEMBERED_PROCESSES)
        self._rivals: dict[bytes, tuple[int, float]] = {}  # processes that were fenced: how often, and when last
        self._former: dict[tuple[str, bool], ChannelState] = {}
        self._newest: dict[tuple[str, str, str], ChannelState] = {}

    @property
    def epochs(self) -> int:
        """How many outboxes, or lives of one, the robot has had."""
        if self.owner_counts is not None:
            return self.owner_epochs
        return 0 if self.streams is None else self.streams.epochs

    @property
    def shown_counts(self) -> Counts:
        """What arrived from it at the gateway where it is, or was last; `counts` is what arrived at this one."""
        return self.owner_counts or self.counts

    def begin(self, robot: Robot, *, session_id: bytes, session_number: int) -> bool:
        """A new session; a new agent process also starts its channels afresh, keeping the topics' counts.

        True when a process is back after another one had followed it: then there are two of them.
        """
        other, self.robot = robot != self.robot, robot
        self.session_number = session_number
        back = session_id in self._displaced
        if session_id != self._process:
            if self._process not in self._displaced:
                self._displaced.append(self._process)
            self._process = session_id
            self.start_channels(self.generation + 1)
        self.revision += 1
        if other:
            self.on_other()
        return back

    def started_remotely(self, session_id: bytes) -> None:
        """A session began at another gateway: if that is another process, the one that was here is followed by it."""
        if session_id != self._process and self._process not in self._displaced:
            self._displaced.append(self._process)

    def start_channels(self, generation: int) -> None:
        """Another process announces its channels from here on; the topics keep their counts."""
        self.generation = generation
        self._former = {(state.channel.topic, state.channel.history): state for state in self.channels.values()}
        self.channels, self._newest = {}, {}
        self.statistics = link_pb2.TopicStatistics()

    def fenced(self, session_id: bytes, *, received_s: float, now_s: float) -> bool:
        """A process was turned away, as a newer session lives.

        True when it keeps coming, and frames of the other came each time since (`received_s`): then there are two. One
        that is back after its clock was set back, before its own former session is held for dead, is alone.
        """
        tries, last_s = self._rivals.pop(session_id, (0, -math.inf))
        tries = tries + 1 if received_s > last_s else 1
        self._rivals[session_id] = tries, now_s
        if len(self._rivals) > REMEMBERED_PROCESSES:
            del self._rivals[next(iter(self._rivals))]
        return tries >= RIVAL_TRIES

    def set_online(self, online: bool, *, wall_ns: int) -> None:
        """The link to this gateway came or went. One that came is the only one."""
        self.here = online
        if online:
            self.owner_gateway, self.owner_session, self.owner_counts = "", 0, None
        self._moved(wall_ns)

    def set_owner(self, gateway: str, session_number: int, *, wall_ns: int) -> None:
        """It is linked to another gateway, or with "" to that one no more."""
        self.owner_gateway, self.owner_session = gateway, session_number
        self._moved(wall_ns)

    def _moved(self, wall_ns: int) -> None:
        online = self.here or bool(self.owner_gateway)
        if online != self.online:
            self.online = online
            self.since_ns = wall_ns
            self.rtt_s = None
        self.last_seen_ns = wall_ns
        self.revision += 1

    def announce(self, channels: Iterable[Channel], series: Iterable[Series]) -> None:
        """Channels and series were declared or changed."""
        for channel in channels:
            state = self.channels.get(channel.channel_id)
            if state is None:
                former = self._former.pop((channel.topic, channel.history), None)
                if former is None and not channel.history:
                    former = self._newest.get(kind(channel))
                state = self.channels[channel.channel_id] = ChannelState(channel)
                if former is not None:
                    state.received, state.received_bytes = former.received, former.received_bytes
                    state.lost, state.last_stamp_ns = former.lost, former.last_stamp_ns
            state.channel = channel
            if channel.history:
                continue
            newest = self._newest.setdefault(kind(channel), state)
            if newest.channel.channel_id < channel.channel_id:
                self._newest[kind(channel)] = state
        for item in series:
            state_of = self.series.pop(item.name, None) or SeriesState(item)
            state_of.series = item
            self.series[item.name] = state_of
        while len(self.series) > REMEMBERED_SERIES:
            del self.series[next(iter(self.series))]
        self.revision += 1

    def count_run(self, run: Run, duplicates: int, *, now_s: float, fresh: bool = True) -> None:
        """Samples of a channel arrived; those that are not `fresh` are of a time without a link."""
        self._arrived(run.count, run.size_bytes, duplicates, run.receive_ns, now_s)
        state = self.channels.get(run.channel.channel_id)
        if state is not None and run.count:
            state.received += run.count
            state.received_bytes += run.size_bytes
            if fresh or state.last_stamp_ns is None:
                state.last_stamp_ns = int(run.columns.stamps_ns[-1])
            if fresh and not run.channel.history:
                self.lag_ns = min(run.receive_ns - int(run.columns.stamps_ns[-1]), LONGEST_LAG_NS)

    def count_rows(
        self, rows: Rows, duplicates: int, *, wall_ns: int, now_s: float, fresh: bool = True
    ) -> dict[str, tuple[int, float]]:
        """Metric rows arrived; the newest (stamp, value) of each series in them, where that is newer than what was."""
        self._arrived(len(rows), 20 * len(rows), duplicates, wall_ns, now_s)
        if not len(rows):
            return {}
        counts = np.bincount(rows.index, minlength=len(rows.series)).tolist()
        last = np.zeros(len(rows.series), np.int64)
        last[rows.index] = np.arange(len(rows))  # of equal indices the last assignment stays
        stamps, values = rows.stamps[last].tolist(), rows.values[last].tolist()
        newest: dict[str, tuple[int, float]] = {}
        for series, count, stamp_ns, value in zip(rows.series, counts, stamps, values, strict=True):
            if count:
                state = self.series.get(series.name)
                if state is None:
                    state = self.series[series.name] = SeriesState(series)
                state.samples += count
                if fresh or state.stamp_ns is None or stamp_ns > state.stamp_ns:
                    state.stamp_ns, state.value = stamp_ns, value
                    newest[series.name] = (stamp_ns, value)
        return newest

    def count_gap(self, stream_id: int, gap: Gap) -> None:
        """A loss was declared."""
        self.counts.gaps += 1
        self.counts.lost += gap.count
        state = self.channels.get(stream_id & CHANNEL_MASK)
        if stream_id & CHANNEL_MASK != METRIC_STREAM and state is not None:
            state.lost += gap.count
            if state.channel.history and (topic := self._newest.get(kind(state.channel))) is not None:
                topic.lost += gap.count
        self.revision += 1

    def over_quota(self, dropped: int, *, put_off: bool) -> None:
        """The robot sent more than it may: live samples were dropped, or a lane was told to send later."""
        self.counts.over_quota += dropped
        self.counts.put_off += put_off
        self.revision += 1

    def report(self, statistics: link_pb2.TopicStatistics) -> None:
        """The agent's statistics came."""
        self.statistics = statistics
        for rate in statistics.topics:
            state = self.channels.get(rate.channel_id)
            if state is not None:
                state.rate = rate
        self.revision += 1

    def budgeted(self, bytes_per_s: int | None) -> None:
        """The agent took another byte budget; its next statistics will say so too."""
        self.statistics.link.budget_bytes_per_s = bytes_per_s or 0
        self.revision += 1

    def channel_of(self, topic: str) -> Channel | None:
        """The announced channel of a topic."""
        return next((state.channel for state in self._newest.values() if state.channel.topic == topic), None)

    def listed(self) -> int:
        """How many channels people are shown."""
        return sum(not state.channel.history for state in self.channels.values())

    def topics(self) -> list[ChannelState]:
        """The newest channel of each topic and type, by topic: one whose class changed has another than before."""
        return sorted(self._newest.values(), key=lambda state: state.channel.topic)

    def newest(self) -> dict[str, tuple[int, float]]:
        """The newest (stamp, value) of every series that has one, by name."""
        return {
            name: (state.stamp_ns, state.value)
            for name, state in sorted(self.series.items())
            if state.stamp_ns is not None and state.value is not None
        }

    def headline(self) -> dict[str, tuple[int, float]]:
        """The newest values of the first series by name, as many as a fleet page can show."""
        return dict(islice(self.newest().items(), HEADLINE_SERIES))

    def _arrived(self, samples: int, size_bytes: int, duplicates: int, wall_ns: int, now_s: float) -> None:
        self.counts.samples += samples
        self.counts.bytes += size_bytes
        self.counts.duplicates += duplicates
        self.last_seen_ns = wall_ns
        self.byte_rate.add(size_bytes, now_s)
        self.revision += 1


def kind(channel: Channel) -> tuple[str, str, str]:
    """What makes two channels the same to people."""
    return channel.topic, channel.schema_name, channel.type_hash


class Registry:
    """All robots by id. `revision` grows when there is another one, or one says other things of itself."""

    def __init__(self) -> None:
        self.revision = 0
        self._records: dict[str, RobotRecord] = {}
        self._ids: list[str] = []  # in order: a page of ten thousand robots sorts nothing
        self._sorted: list[RobotRecord] = []  # in the same order

    def add(self, record: RobotRecord) -> RobotRecord:
        """Know a robot; the first record of an id stays."""
        if record.robot.id not in self._records:
            place = bisect_right(self._ids, record.robot.id)
            self._ids.insert(place, record.robot.id)
            self._sorted.insert(place, record)
            record.on_other = self._changed
            self._changed()
        return self._records.setdefault(record.robot.id, record)

    def get(self, robot_id: str) -> RobotRecord:
        """A robot's record, or UnknownRobotError."""
        record = self._records.get(robot_id)
        if record is None:
            raise UnknownRobotError.of(robot_id)
        return record

    def find(self, robot_id: str) -> RobotRecord | None:
        """A robot's record, or None."""
        return self._records.get(robot_id)

    def all(self) -> list[RobotRecord]:
        """Every robot, by id."""
        return list(self._sorted)

    def behind(self, robot_id: str, most: int) -> list[RobotRecord]:
        """At most so many robots behind an id, which need not be one, by id; from the first with ""."""
        start = bisect_right(self._ids, robot_id) if robot_id else 0
        return self._sorted[start : start + most]

    def _changed(self) -> None:
        self.revision += 1
