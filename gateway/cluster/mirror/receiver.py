"""Keeps remote robots in this gateway's registry, from the messages of their owners.

Of two gateways that both say they have a robot, the newer session has it: what the former owner says late counts no
more. What a owner says of its own robots comes in order, so that its last word about each is true.
"""

from __future__ import annotations

import asyncio
import logging
import struct
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Final

from google.protobuf.message import DecodeError

from gateway.cluster.mirror.deltas import digest_of
from gateway.cluster.mirror.sender import MIRROR, MIRROR_AGAIN, MIRROR_FAST
from gateway.cluster.ports import Mesh
from gateway.domain.channel import CLASSES, LIVE, Channel, Series
from gateway.domain.robot import Robot, is_robot_id
from gateway.ingest.registry import Counts, Registry, RobotRecord, SeriesState
from gateway.live.hub import Hub
from metaros._proto import cluster_pb2, link_pb2
from metaros.clock import Clock

__all__ = ["MirrorReceiver"]

log = logging.getLogger(__name__)

LOOK_S: Final = 0.1  # how often it is looked whether somebody looks at values here
ORPHAN_S: Final = (
    3.0  # for so long a robot whose owner died may take to come elsewhere, before it is said to be offline
)
ORPHANS_AT_ONCE: Final = 32
OnRemoteSession = Callable[[str, str, int], None]  # a robot, the gateway, and its session's number there


@dataclass(slots=True)
class _Peer:
    """What one gateway has sent."""

    schemas: dict[bytes, bytes] = field(default_factory=dict)
    series: dict[str, dict[int, Series]] = field(default_factory=dict)  # of robots that it introduced, by their numbers
    seen: set[str] | None = None  # robots that it introduced while it tells all of it
    fast: bool | None = None  # what it was told of that


class MirrorReceiver:
    """All methods on the event loop."""

    def __init__(self, mesh: Mesh, registry: Registry, hub: Hub, *, clock: Clock) -> None:
        self._mesh = mesh
        self._registry = registry
        self._hub = hub
        self._clock = clock
        self._peers: dict[str, _Peer] = {}
        self._passed_over: dict[str, str] = {}  # robot: who said that it has it, when another one had a newer session
        self._orphans: deque[tuple[float, str]] = deque()  # since when, and who
        self._watchers: dict[Callable[[str], None], None] = {}
        self.on_remote_session: OnRemoteSession = lambda robot, gateway, number: None
        self.on_orphan: Callable[[str], None] = lambda robot: None
        mesh.on_message(MIRROR, self._on_update)
        mesh.on_peer(self._on_peer)

    def of(self, gateway: str) -> list[str]:
        """The robots that are linked to another gateway, by its id."""
        peer = self._peers.get(gateway)
        return (
            [robot for robot in peer.series if self._registry.get(robot).owner_gateway == gateway]
            if peer is not None
            else []
        )

    @property
    def mirrored(self) -> int:
        """How many robots are linked to other gateways."""
        return sum(len(self.of(gateway)) for gateway in self._peers)

    def watch(self, callback: Callable[[str], None]) -> Callable[[], None]:
        """Call back with the id of each robot whose owner came, went or changed; returns what ends that."""
        self._watchers[callback] = None

        def stop() -> None:
            self._watchers.pop(callback, None)

        return stop

    def on_online(self, robot: str, online: bool) -> None:
        """A robot's link to this gateway came or went."""
        if not online:
            self._ask_again(robot)
            return
        for peer in self._peers.values():
            peer.series.pop(robot, None)
        self._notify_watchers(robot)

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            fast = self._hub.feeding
            for gateway, peer in self._peers.items():
                if peer.fast is not fast and self._mesh.send(gateway, MIRROR_FAST, b"1" if fast else b""):
                    peer.fast = fast
            await self._look_at_orphans()

    def _on_peer(self, gateway: str, came: bool) -> None:
        """One that went took its robots' links with it; of those that stay, one says so to everybody."""
        known = self._peers.pop(gateway, None)
        if came:
            self._peers[gateway] = _Peer()
        if known is None:
            return
        now_s = self._clock.monotonic_s()
        speaks = self._mesh.gateway_id < min(self._mesh.peers() - {gateway}, default="~")
        for robot in known.series:
            record = self._registry.get(robot)
            if record.owner_gateway == gateway:
                self._lose(record)
                if speaks and not record.online:
                    self._orphans.append((now_s, robot))

    async def _look_at_orphans(self) -> None:
        """Those that nobody has after a while are offline; most are at another gateway by then."""
        due_s = self._clock.monotonic_s() - ORPHAN_S
        notified = 0
        while self._orphans and self._orphans[0][0] <= due_s:
            _, robot = self._orphans.popleft()
            if not self._registry.get(robot).online:
                self.on_orphan(robot)
                notified += 1
                if notified % ORPHANS_AT_ONCE == 0:
                    await asyncio.sleep(0)

    def _on_update(self, sender: str, payload: bytes) -> None:
        peer = self._peers.setdefault(sender, _Peer())
        try:
            update = cluster_pb2.Mirror.FromString(payload)
        except DecodeError:
            log.error("gateway %s sent a robot state that cannot be read: is it of another version?", sender)
            return
        if update.anew:
            peer.schemas, peer.seen = {}, set()
        for text in update.schemas:
            peer.schemas[digest_of(text)] = text
        for piece in update.robots:
            self._take(sender, peer, piece)
        if update.whole and peer.seen is not None:
            missing = [robot for robot in peer.series if robot not in peer.seen]
            peer.seen = None
            for robot in missing:
                self._gone(sender, peer, robot)

    def _take(self, sender: str, peer: _Peer, piece: cluster_pb2.MirroredRobot) -> None:
        robot = piece.robot
        if piece.gone:
            self._gone(sender, peer, robot)
            return
        if piece.HasField("introduction") and not self._introduced(sender, peer, robot, piece.introduction):
            return
        record = self._registry.find(robot)
        if record is None or record.owner_gateway != sender or record.here or robot not in peer.series:
            return
        if piece.channels or piece.series:
            self._announced(sender, peer, record, piece)
        self._newest(peer.series[robot], record, piece.values)
        if piece.HasField("state"):
            self._state(record, piece.state)
        if piece.HasField("statistics"):
            record.report(piece.statistics)
        for count in piece.counts:
            _count(record, count)

    def _introduced(self, sender: str, peer: _Peer, robot: str, said: cluster_pb2.Introduction) -> bool:
        """A robot is linked to the sender, or says other things of itself there; False where somebody has it newer."""
        if not is_robot_id(robot):
            return False
        who = Robot(robot, said.namespace, said.hostname, said.agent_version, dict(said.labels))
        record = self._registry.find(robot)
        if record is None:
            record = self._registry.add(RobotRecord(who, seen_ns=said.since_ns))
        newer_than = record.session_number if record.here else record.owner_session
        if (record.here or record.owner_gateway not in ("", sender)) and said.session_number <= newer_than:
            self._passed_over[robot] = sender
            return False
        self._passed_over.pop(robot, None)
        before = record.owner_gateway
        if peer.seen is not None:
            peer.seen.add(robot)
        peer.series[robot] = {}
        record.set_owner(sender, said.session_number, wall_ns=self._clock.wall_ns())
        if record.here:  # the link here is an older session's: whoever has links ends it, and it is only there
            self.on_remote_session(robot, sender, said.session_number)
        _identify(record, who, said, anew=before != sender)
        self._moved(robot)
        return True

    def _gone(self, sender: str, peer: _Peer, robot: str) -> None:
        peer.series.pop(robot, None)
        if self._passed_over.get(robot) == sender:
            del self._passed_over[robot]
        record = self._registry.find(robot)
        if record is not None and record.owner_gateway == sender:
            self._lose(record)

    def _lose(self, record: RobotRecord) -> None:
        """It is not linked to its owner any more."""
        record.set_owner("", 0, wall_ns=self._clock.wall_ns())
        self._moved(record.robot.id)
        self._ask_again(record.robot.id)

    def _ask_again(self, robot: str) -> None:
        """Somebody may have it with an older session, as its clock was set back."""
        gateway = self._passed_over.pop(robot, None)
        if gateway is not None:
            self._mesh.send(gateway, MIRROR_AGAIN, cluster_pb2.MirrorAgain(robots=[robot]).SerializeToString())

    def _moved(self, robot: str) -> None:
        self._notify_watchers(robot)
        self._hub.channels_changed(robot)

    def _notify_watchers(self, robot: str) -> None:
        for callback in list(self._watchers):
            callback(robot)

    def _announced(self, sender: str, peer: _Peer, record: RobotRecord, piece: cluster_pb2.MirroredRobot) -> None:
        robot, numbers = record.robot.id, peer.series[record.robot.id]
        if any(channel.schema and channel.schema not in peer.schemas for channel in piece.channels):
            log.warning("gateway %s names a schema that it did not send: asked again", sender)
            self._mesh.send(sender, MIRROR_AGAIN, cluster_pb2.MirrorAgain(robots=[robot]).SerializeToString())
        channels = [_channel(robot, wire, peer.schemas.get(wire.schema, b"")) for wire in piece.channels]
        series = {wire.series_id: Series(wire.name, wire.topic, wire.field) for wire in piece.series}
        numbers.update(series)
        record.announce(channels, series.values())
        if channels:
            self._moved(robot)

    def _newest(self, numbers: dict[int, Series], record: RobotRecord, update: link_pb2.MetricBatch) -> None:
        if not update.count:
            return
        newest: dict[str, tuple[int, float]] = {}
        for number, stamp_ns, value in _rows(update):
            series = numbers.get(number)
            if series is None:
                continue
            state = record.series.get(series.name)
            if state is None:
                state = record.series[series.name] = SeriesState(series)
            state.stamp_ns, state.value = stamp_ns, value
            newest[series.name] = (stamp_ns, value)
        record.revision += 1
        if newest:
            self._hub.values(record.robot.id, newest)

    def _state(self, record: RobotRecord, update: cluster_pb2.MirroredState) -> None:
        record.last_seen_ns = update.last_seen_ns
        record.rtt_s = update.rtt_s if update.HasField("rtt_s") else None
        record.lag_ns = update.lag_ns if update.HasField("lag_ns") else None
        record.byte_rate.set(update.bytes_per_s, self._clock.monotonic_s())
        record.owner_counts = Counts(
            update.samples, update.bytes, update.duplicates, update.gaps, update.lost, update.over_quota, update.put_off
        )
        record.forks, record.owner_epochs = update.forks, update.epochs
        record.revision += 1


def _identify(record: RobotRecord, who: Robot, said: cluster_pb2.Introduction, *, anew: bool) -> None:
    """What a robot says of itself at its owner; its channels begin afresh with another process, or at another owner."""
    other, record.robot = record.robot != who, who
    record.session_number, record.since_ns = said.session_number, said.since_ns
    if anew or record.generation != said.generation:
        record.start_channels(said.generation)
    record.owner_counts = record.owner_counts or Counts()
    record.revision += 1
    if other:
        record.on_other()


def _channel(robot: str, wire: link_pb2.Channel, schema: bytes) -> Channel:
    return Channel(
        robot=robot,
        channel_id=wire.channel_id,
        topic=wire.topic,
        schema_name=wire.schema_name,
        type_hash=wire.type_hash,
        encoding=wire.encoding,
        schema_encoding=wire.schema_encoding,
        schema=schema,
        qos=wire.qos,
        delivery=CLASSES.get(getattr(wire, "class"), LIVE),
        max_rate_hz=wire.max_rate_hz,
        forward=wire.forward,
        history=wire.history,
        history_rate_hz=wire.history_rate_hz,
    )


def _rows(update: link_pb2.MetricBatch) -> Iterable[tuple[int, int, float]]:
    """Series, stamp and value of each row; none where the columns do not fit."""
    count = update.count
    if (len(update.series_ids), len(update.stamps), len(update.values)) != (4 * count, 8 * count, 8 * count):
        return ()
    numbers = struct.unpack(f"<{count}I", update.series_ids)
    stamps = struct.unpack(f"<{count}q", update.stamps)
    return zip(numbers, stamps, struct.unpack(f"<{count}d", update.values), strict=True)


def _count(record: RobotRecord, update: cluster_pb2.TopicCount) -> None:
    state = record.channels.get(update.channel_id)
    if state is not None:
        state.received, state.received_bytes, state.lost = update.received, update.received_bytes, update.lost
        state.last_stamp_ns = update.last_stamp_ns if update.HasField("last_stamp_ns") else None
