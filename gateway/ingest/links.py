"""Sessions at work: fencing, what their events cause, acknowledgements after commits, silence and shutdown.

No gRPC here: a lane is a `LaneOutbox` and frames that somebody feeds in.
"""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence
from dataclasses import replace

from gateway.domain.identity import Admitted
from gateway.errors import FencedError, ForkedError, RobotOfflineError, StoreError, UnprovenError, UnsettledError
from gateway.ingest.events import (
    Announced,
    Arrived,
    Closed,
    Event,
    GapDeclared,
    LeasesAnswered,
    Measured,
    Online,
    OverQuota,
    RecordingArrived,
    Reported,
    Resulted,
    RosReceived,
    RowsArrived,
    Send,
    TwinReported,
    WriterKnown,
)
from gateway.ingest.handshake import LANES, check_hello
from gateway.ingest.hooks import LinkHooks
from gateway.ingest.lane import Lane, LiveLink
from gateway.ingest.lane_limits import LaneLimits
from gateway.ingest.outbox import LaneOutbox
from gateway.ingest.quota import Meter, Quota
from gateway.ingest.registry import Registry, RobotRecord
from gateway.ingest.robot_authenticator import NoAuthentication, RobotAuthenticator
from gateway.ingest.session import Session
from gateway.ingest.stall_detector import StallDetector
from gateway.ingest.streams import StreamTable
from gateway.store import Committed, RobotWrite, Store, StreamWrite, WriterWrite
from metaros._proto import link_pb2
from metaros.clock import Clock
from metaros.limits import LIMITS, Limits

__all__ = ["Lane", "LinkHooks", "Links"]

log = logging.getLogger(__name__)

OUTBOX_BYTES = 4 * LIMITS.frame_bytes
SEEN_EVERY_S = 60.0
FENCED_RETRY_MS = 5000
QUOTA_SAID_S = 60.0
BACK_MS, BACK_PER_S, BACK_MOST_MS = 200, 500, 10_000  # after a Goodbye: the first one's, how many a second, the last
RETRY_MS = 250  # how long agents keep durable frames while the store cannot take them


class Links:
    """All sessions of this gateway."""

    def __init__(
        self,
        registry: Registry,
        store: Store,
        hooks: LinkHooks,
        *,
        clock: Clock,
        quota: Quota | None = None,
        authenticator: RobotAuthenticator | None = None,
        limits: Limits = LIMITS,
    ) -> None:
        """`quota` is each robot's; None: no limit. `authenticator` checks who they are; None believes their ids."""
        self.authenticator: RobotAuthenticator = authenticator or NoAuthentication()
        self._quota = quota or Quota()
        self._registry = registry
        self._store = store
        self._hooks = hooks
        self._clock = clock
        self._limits = replace(limits, window_bytes=self._quota.window_bytes(limits))
        self.lane_limits = LaneLimits(clock=clock, limits=limits)
        self._live: dict[str, LiveLink] = {}
        self._stall_detector = StallDetector()

    def check(self, hello: link_pb2.Hello) -> None:
        """Before anybody believes a Hello: its form. ProtocolError when that is wrong."""
        check_hello(hello, limits=self._limits)

    async def join(self, hello: link_pb2.Hello, admitted: Admitted) -> Lane:
        """Open a lane for a Hello of an authenticated robot; a LinkError says why it may not."""
        robot = check_hello(hello, limits=self._limits)
        record = self._registry.find(robot.id)
        if record is None:
            record = self._registry.add(RobotRecord(robot, seen_ns=self._clock.wall_ns()))
        async with record.joining:
            streams = record.streams = await self._streams(record, hello)
            if streams.forked(hello):
                record.forks += 1
                raise ForkedError(f"another copy of the outbox of {robot.id} has spoken under its epoch")
            self.authenticator.recheck(admitted)  # it may have been revoked while the store was asked
            live = self._admit(hello, record, streams)
            live.admitted.add(admitted)
            outbox = LaneOutbox(max_bytes=OUTBOX_BYTES)
            events = live.session.open_lane(hello, now_s=self._clock.monotonic_s(), wall_ns=self._clock.wall_ns())
            live.outboxes[hello.lane] = outbox
            self._apply(live, events)
        return Lane(robot.id, hello.lane, outbox, live)

    async def receive(self, lane: Lane, frame: link_pb2.AgentFrame) -> None:
        """A frame of a lane; waits while the store's queue is full, so that the agent's window fills instead."""
        while not await self._store.room(timeout_s=1.0):
            lane.live.session.touch(lane.number, now_s=self._clock.monotonic_s())
        if self._store.error is not None:
            self._apply(lane.live, lane.live.session.refuse("store_error", retry_after_ms=RETRY_MS))
        now_s, wall_ns = self._clock.monotonic_s(), self._clock.wall_ns()
        self._apply(lane.live, lane.live.session.receive(lane.number, frame, now_s=now_s, wall_ns=wall_ns))

    def ended(self, lane: Lane) -> None:
        """A lane's connection is gone."""
        if lane.live.outboxes.get(lane.number) is lane.outbox:
            self._apply(lane.live, lane.live.session.lane_ended())

    def has(self, robot_id: str) -> bool:
        """Whether the robot has its whole link here."""
        live = self._live.get(robot_id)
        return live is not None and live.session.online

    def process_of(self, robot_id: str) -> bytes:
        """The id of the agent's process that has its whole link here; b"" for none."""
        live = self._live.get(robot_id)
        return live.session.session_id if live is not None and live.session.online else b""

    def started_remotely(self, robot_id: str, session_id: bytes) -> None:
        """A session of that process began at another gateway. Should the one before it come back, there are two."""
        if (record := self._registry.find(robot_id)) is not None:
            record.started_remotely(session_id)

    def fence(self, robot_id: str, session_number: int) -> None:
        """A session of that number lives at another gateway: one here that is not newer ends."""
        live = self._live.get(robot_id)
        if live is not None and live.session.number <= session_number:
            text = "a newer session took over at another gateway"
            self._apply(live, live.session.close("fenced", text, retry_after_ms=FENCED_RETRY_MS))

    def send(self, robot_id: str, frame: link_pb2.GatewayFrame, *, lane: int = LANES[0]) -> None:
        """Put a frame on a lane of the robot's, by default control; RobotOfflineError when it has no link."""
        live = self._live.get(robot_id)
        control = lane == LANES[0]  # commands need the whole link; an answer on another lane needs that one alone
        if live is None or lane not in live.outboxes or (control and not live.session.online):
            raise RobotOfflineError(f"robot {robot_id} has no link now")
        self._put(live, lane, frame)

    def committed(self, done: Committed) -> None:
        """A commit is done: move the stored watermarks and acknowledge them, one Ack a robot."""
        for write in done.writes:
            if not isinstance(write, WriterWrite | StreamWrite):
                continue
            if (streams := self._registry.get(write.robot).streams) is None:
                continue
            if isinstance(write, WriterWrite):
                streams.commit_writer(write.epoch, write.writer)
            else:
                streams.settled(write.epoch)
        acks: dict[str, list[tuple[int, int, int]]] = {}
        for mark in done.marks:
            acks.setdefault(mark.robot, []).append((mark.stream_id, mark.epoch, mark.seq))
        for robot_id, marks in acks.items():
            record, live = self._registry.get(robot_id), self._live.get(robot_id)
            streams = record.streams
            if streams is not None and not all(streams.confirm(*mark) for mark in marks):
                self._went_back(record, live)
                continue
            if live is not None:
                self._apply(live, live.session.committed(marks))

    def _went_back(self, record: RobotRecord, live: LiveLink | None) -> None:
        """The store has less than it had: it was restored meanwhile. The agent must hear of it in a Welcome."""
        log.error("robot %s: the store has lost samples that it had acknowledged", record.robot.id)
        if live is not None:
            self._apply(live, live.session.close("store_behind", "the store has gone back in time"))
        record.streams = None

    def refused(self, robots: Collection[str]) -> None:
        """The store gave up what these robots had queued: they send it again later."""
        for robot_id in robots:
            if (record := self._registry.find(robot_id)) is not None and record.streams is not None:
                record.streams.gave_up()
            if (live := self._live.get(robot_id)) is not None:
                self._apply(live, live.session.refuse("store_error", retry_after_ms=RETRY_MS))

    def tick(self) -> None:
        """Heartbeats and dead links; call several times a second."""
        now_s, wall_ns = self._clock.monotonic_s(), self._clock.wall_ns()
        since_s = self._stall_detector.tick(now_s)
        for live in list(self._live.values()):
            self._apply(live, live.session.tick(now_s=now_s, wall_ns=wall_ns, since_s=since_s))
            if not live.closed and now_s - live.seen_s >= SEEN_EVERY_S:
                live.seen_s = now_s
                self._store.submit(RobotWrite(live.record.robot, wall_ns))

    def recheck(self) -> None:
        """End every link whose robot may not stay any more; call whenever identities may have changed."""
        for live in list(self._live.values()):
            try:
                for admitted in live.admitted:
                    self.authenticator.recheck(admitted)
            except UnprovenError as error:
                ending = live.session.close(error.code, str(error), retry_after_ms=error.retry_after_ms)
                self._apply(live, ending)

    def close(self) -> None:
        """Say goodbye on every lane: the gateway goes down and wants its agents back soon, but not all at once."""
        for number, live in enumerate(list(self._live.values())):
            retry_ms = BACK_MS + min(1000 * number // BACK_PER_S, BACK_MOST_MS)
            self._apply(
                live, live.session.close("shutting_down", "the gateway is shutting down", retry_after_ms=retry_ms)
            )

    async def _streams(self, record: RobotRecord, hello: link_pb2.Hello) -> StreamTable:
        """The robot's watermarks: as we know them, or as the store does, when somebody else may write there too."""
        live, robot_id = self._live.get(record.robot.id), record.robot.id
        # Between two sessions the agent may have been at another gateway.
        opened = (live.session.session_id, live.session.number) if live is not None else None
        ours = opened == (hello.session_id, hello.session_number)
        if record.streams is not None and (ours or not self._store.shared):
            return record.streams
        known = record.streams.known() if record.streams is not None else {}
        try:
            stored, writers = await self._store.streams(robot_id), await self._store.writers(robot_id)
        except StoreError as error:
            raise UnsettledError(f"the store cannot be read now: {error}") from error
        if any(stored.get(key, 0) < seq for key, seq in known.items()):
            self._went_back(record, live)
        if record.streams is None:
            return StreamTable(stored, writers=writers)
        record.streams.refresh(stored, writers)
        return record.streams

    def _admit(self, hello: link_pb2.Hello, record: RobotRecord, streams: StreamTable) -> LiveLink:
        """The session this Hello belongs to: the living one, or a new one that fences it."""
        live = self._live.get(hello.robot_id)
        if live is not None:
            if hello.session_number == live.session.number and hello.session_id == live.session.session_id:
                return live
            if hello.session_number <= live.session.number:
                if record.fenced(hello.session_id, received_s=live.session.received_s, now_s=self._clock.monotonic_s()):
                    self.authenticator.cloned(hello.robot_id)
                raise FencedError(f"session {live.session.number} of {hello.robot_id} is alive and newer")
            fenced = live.session.close("fenced", "a newer session took over", retry_after_ms=FENCED_RETRY_MS)
            self._apply(live, fenced)
        elif record.owner_gateway and hello.session_number <= record.owner_session:  # no rival: it may be late
            raise FencedError(
                f"session {record.owner_session} of {hello.robot_id} is alive at another gateway and newer"
            )
        record.meter = record.meter or Meter(self._quota, limits=self._limits)
        session = Session(
            hello,
            streams,
            gateway_id=self._store.gateway_id,
            store_id=self._store.store_id,
            limits=self._limits,
            meter=record.meter,
            fetch_token=self._hooks.fetch_token(hello.robot_id),
        )
        if record.begin(session.robot, session_id=session.session_id, session_number=session.number):
            self.authenticator.cloned(hello.robot_id)
        live = self._live[hello.robot_id] = LiveLink(session, record, seen_s=self._clock.monotonic_s())
        self._store.submit(RobotWrite(session.robot, self._clock.wall_ns()))
        return live

    def _apply(self, live: LiveLink, events: Sequence[Event]) -> None:
        for event in events:
            if isinstance(event, Send):
                self._put(live, event.lane, event.frame)
            else:
                self._happened(live, event)

    def _put(self, live: LiveLink, lane: int, frame: link_pb2.GatewayFrame) -> None:
        outbox = live.outboxes.get(lane)
        if outbox is not None and not outbox.put(frame) and not live.closed:
            self._apply(live, live.session.close("too_slow", "the agent does not read its lane"))

    def _happened(self, live: LiveLink, event: Event) -> None:
        record, robot_id = live.record, live.record.robot.id
        wall_ns, now_s = self._clock.wall_ns(), self._clock.monotonic_s()
        if isinstance(event, Arrived):
            record.count_run(event.run, event.duplicates, now_s=now_s, fresh=event.fresh)
            if event.run.count and event.fresh and not event.run.channel.history:
                self._hooks.on_samples(event.run)
            if event.durable:
                self._store_run(live, event)
        elif isinstance(event, RowsArrived):
            newest = record.count_rows(event.rows, event.duplicates, wall_ns=wall_ns, now_s=now_s, fresh=event.fresh)
            if newest:
                self._hooks.on_values(robot_id, newest)
            self._store_rows(live, event)
        elif isinstance(event, WriterKnown):
            for epoch, writer in event.writers.items():
                self._store.submit(WriterWrite(robot=robot_id, epoch=epoch, writer=writer))
        elif isinstance(event, GapDeclared):
            self._store_gap(live, event)
        elif isinstance(event, Announced):
            record.announce(event.channels, event.series)
            self._hooks.on_channels(robot_id)
        elif isinstance(event, Reported):
            record.report(event.statistics)
        elif isinstance(event, RecordingArrived):
            self._hooks.on_recording(robot_id, event.part)
        elif isinstance(event, Resulted):
            self._hooks.on_result(robot_id, event.result)
        elif isinstance(event, TwinReported):
            self._hooks.on_twin(robot_id, event.report)
        elif isinstance(event, RosReceived):
            self._hooks.on_ros(robot_id, event.frame)
        elif isinstance(event, LeasesAnswered):
            self._hooks.on_leases(robot_id, event.boot_ns)
        elif isinstance(event, OverQuota):
            self._over_quota(record, event)
        elif isinstance(event, Measured):
            record.rtt_s = event.rtt_s
        elif isinstance(event, Online):
            record.set_online(True, wall_ns=wall_ns)
            self._hooks.on_online(robot_id, True)
        elif isinstance(event, Closed):
            self._closed(live, event)

    def _over_quota(self, record: RobotRecord, event: OverQuota) -> None:
        """Count it, and say so once in a while."""
        record.over_quota(event.dropped, put_off=event.put_off)
        now_s = self._clock.monotonic_s()
        if now_s - record.quota_said_s >= QUOTA_SAID_S:
            record.quota_said_s = now_s
            log.warning(
                "robot %s sends more than --robot-messages-per-s or --robot-bytes-per-s allow: "
                "it sends durable samples later, live ones are dropped",
                record.robot.id,
            )

    def _store_run(self, live: LiveLink, event: Arrived) -> None:
        columns = event.run.columns
        write = StreamWrite(
            robot=live.record.robot.id,
            stream_id=columns.stream_id,
            epoch=event.epoch,
            seq=event.seq,
            run=event.run if event.run.count else None,
            base=self._base(live, columns.stream_id, event.epoch),
        )
        self._submit(live, write)

    def _store_rows(self, live: LiveLink, event: RowsArrived) -> None:
        write = StreamWrite(
            robot=live.record.robot.id,
            stream_id=event.stream_id,
            epoch=event.epoch,
            seq=event.seq,
            rows=event.rows if len(event.rows) else None,
            base=self._base(live, event.stream_id, event.epoch),
        )
        self._submit(live, write)

    def _store_gap(self, live: LiveLink, event: GapDeclared) -> None:
        robot_id, gap = live.record.robot.id, event.gap
        live.record.count_gap(event.stream_id, gap)
        log.warning("robot %s lost %d samples of stream %d (%s)", robot_id, gap.count, event.stream_id, gap.reason)
        write = StreamWrite(
            robot=robot_id,
            stream_id=event.stream_id,
            epoch=event.epoch,
            seq=gap.to_seq,
            gap=gap,
            base=self._base(live, event.stream_id, event.epoch),
        )
        self._submit(live, write)

    @staticmethod
    def _base(live: LiveLink, stream_id: int, epoch: int) -> int:
        return live.record.streams.base(stream_id, epoch) if live.record.streams is not None else 0

    def _submit(self, live: LiveLink, write: StreamWrite) -> None:
        if live.record.streams is not None:
            live.record.streams.submitted(write.epoch)
        self._store.submit(write)

    def _closed(self, live: LiveLink, event: Closed) -> None:
        live.closed = True
        robot_id = live.record.robot.id
        if event.code not in ("", "shutting_down"):
            log.warning("robot %s: link closed: %s: %s", robot_id, event.code, event.message)
        for outbox in live.outboxes.values():
            outbox.close()
        if self._live.get(robot_id) is live:
            del self._live[robot_id]
            wall_ns = self._clock.wall_ns()
            live.record.set_online(False, wall_ns=wall_ns)
            self._store.submit(RobotWrite(live.record.robot, wall_ns))
            self._hooks.on_online(robot_id, False)
