"""Robots that are linked to other gateways, kept in this one's registry as their homes tell of them.

Of two gateways that both say they have a robot, the newer session has it: what the former home says late counts no
more. What a home says of its own robots comes in order, so that its last word about each is true.
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

from gateway.cluster.mirror_home import MIRROR, MIRROR_AGAIN, MIRROR_FAST
from gateway.cluster.mirror_pieces import digest_of
from gateway.cluster.ports import Mesh
from gateway.domain.channel import CLASSES, LIVE, Channel, Series
from gateway.domain.robot import Robot, is_robot_id
from gateway.ingest.registry import Counts, Registry, RobotRecord, SeriesState
from gateway.live.hub import Hub
from metaros._proto import cluster_pb2, link_pb2
from metaros.clock import Clock

__all__ = ["MirrorAway"]

log = logging.getLogger(__name__)

LOOK_S: Final = 0.1  # how often it is looked whether somebody looks at values here
ORPHAN_S: Final = 3.0  # for so long a robot whose home died may take to come elsewhere, before it is said to be offline
ORPHANS_AT_ONCE: Final = 32
Elsewhere = Callable[[str, str, int], None]  # a robot, the gateway, and its session's number there


@dataclass(slots=True)
class _Peer:
    """What one gateway told."""

    schemas: dict[bytes, bytes] = field(default_factory=dict)
    series: dict[str, dict[int, Series]] = field(default_factory=dict)  # of robots that it introduced, by their numbers
    seen: set[str] | None = None  # robots that it introduced while it tells all of it
    fast: bool | None = None  # what it was told of that


class MirrorAway:
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
        self.on_elsewhere: Elsewhere = lambda robot, gateway, number: None
        self.on_orphan: Callable[[str], None] = lambda robot: None
        mesh.on_tell(MIRROR, self._on_told)
        mesh.on_peer(self._on_peer)

    def of(self, gateway: str) -> list[str]:
        """The robots that are linked to another gateway, by its id."""
        peer = self._peers.get(gateway)
        return [robot for robot in peer.series if self._registry.get(robot).home == gateway] if peer is not None else []

    @property
    def mirrored(self) -> int:
        """How many robots are linked elsewhere."""
        return sum(len(self.of(gateway)) for gateway in self._peers)

    def watch(self, callback: Callable[[str], None]) -> Callable[[], None]:
        """Be told, by its id, of each robot whose home came, went, or is another one; returns what ends that."""
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
        self._tell_watchers(robot)

    async def run(self) -> None:
        """Until cancelled."""
        while True:
            await asyncio.sleep(LOOK_S)
            fast = self._hub.feeding
            for gateway, peer in self._peers.items():
                if peer.fast is not fast and self._mesh.tell(gateway, MIRROR_FAST, b"1" if fast else b""):
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
            if record.home == gateway:
                self._lose(record)
                if speaks and not record.online:
                    self._orphans.append((now_s, robot))

    async def _look_at_orphans(self) -> None:
        """Those that nobody has after a while are offline; most are at another gateway by then."""
        due_s = self._clock.monotonic_s() - ORPHAN_S
        told = 0
        while self._orphans and self._orphans[0][0] <= due_s:
            _, robot = self._orphans.popleft()
            if not self._registry.get(robot).online:
                self.on_orphan(robot)
                told += 1
                if told % ORPHANS_AT_ONCE == 0:
                    await asyncio.sleep(0)

    def _on_told(self, sender: str, payload: bytes) -> None:
        peer = self._peers.setdefault(sender, _Peer())
        try:
            told = cluster_pb2.Mirror.FromString(payload)
        except DecodeError:
            log.error("gateway %s tells of its robots what cannot be read: is it of another version?", sender)
            return
        if told.anew:
            peer.schemas, peer.seen = {}, set()
        for text in told.schemas:
            peer.schemas[digest_of(text)] = text
        for piece in told.robots:
            self._take(sender, peer, piece)
        if told.whole and peer.seen is not None:
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
        if record is None or record.home != sender or record.here or robot not in peer.series:
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
        newer_than = record.session_number if record.here else record.home_session
        if (record.here or record.home not in ("", sender)) and said.session_number <= newer_than:
            self._passed_over[robot] = sender
            return False
        self._passed_over.pop(robot, None)
        before = record.home
        if peer.seen is not None:
            peer.seen.add(robot)
        peer.series[robot] = {}
        record.set_home(sender, said.session_number, wall_ns=self._clock.wall_ns())
        if record.here:  # the link here is an older session's: whoever has links ends it, and it is only there
            self.on_elsewhere(robot, sender, said.session_number)
        _identify(record, who, said, anew=before != sender)
        self._moved(robot)
        return True

    def _gone(self, sender: str, peer: _Peer, robot: str) -> None:
        peer.series.pop(robot, None)
        if self._passed_over.get(robot) == sender:
            del self._passed_over[robot]
        record = self._registry.find(robot)
        if record is not None and record.home == sender:
            self._lose(record)

    def _lose(self, record: RobotRecord) -> None:
        """It is not linked to its home any more."""
        record.set_home("", 0, wall_ns=self._clock.wall_ns())
        self._moved(record.robot.id)
        self._ask_again(record.robot.id)

    def _ask_again(self, robot: str) -> None:
        """Somebody may have it with an older session, as its clock was set back."""
        gateway = self._passed_over.pop(robot, None)
        if gateway is not None:
            self._mesh.tell(gateway, MIRROR_AGAIN, cluster_pb2.MirrorAgain(robots=[robot]).SerializeToString())

    def _moved(self, robot: str) -> None:
        self._tell_watchers(robot)
        self._hub.channels_changed(robot)

    def _tell_watchers(self, robot: str) -> None:
        for callback in list(self._watchers):
            callback(robot)

    def _announced(self, sender: str, peer: _Peer, record: RobotRecord, piece: cluster_pb2.MirroredRobot) -> None:
        robot, numbers = record.robot.id, peer.series[record.robot.id]
        if any(channel.schema and channel.schema not in peer.schemas for channel in piece.channels):
            log.warning("gateway %s names a schema that it did not tell: asked again", sender)
            self._mesh.tell(sender, MIRROR_AGAIN, cluster_pb2.MirrorAgain(robots=[robot]).SerializeToString())
        channels = [_channel(robot, wire, peer.schemas.get(wire.schema, b"")) for wire in piece.channels]
        series = {wire.series_id: Series(wire.name, wire.topic, wire.field) for wire in piece.series}
        numbers.update(series)
        record.announce(channels, series.values())
        if channels:
            self._moved(robot)

    def _newest(self, numbers: dict[int, Series], record: RobotRecord, told: link_pb2.MetricBatch) -> None:
        if not told.count:
            return
        newest: dict[str, tuple[int, float]] = {}
        for number, stamp_ns, value in _rows(told):
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

    def _state(self, record: RobotRecord, told: cluster_pb2.MirroredState) -> None:
        record.last_seen_ns = told.last_seen_ns
        record.rtt_s = told.rtt_s if told.HasField("rtt_s") else None
        record.lag_ns = told.lag_ns if told.HasField("lag_ns") else None
        record.byte_rate.set(told.bytes_per_s, self._clock.monotonic_s())
        record.told = Counts(
            told.samples, told.bytes, told.duplicates, told.gaps, told.lost, told.over_quota, told.put_off
        )
        record.forks, record.told_epochs = told.forks, told.epochs
        record.revision += 1


def _identify(record: RobotRecord, who: Robot, said: cluster_pb2.Introduction, *, anew: bool) -> None:
    """What a robot says of itself at its home; its channels begin afresh with another process, or at another home."""
    other, record.robot = record.robot != who, who
    record.session_number, record.since_ns = said.session_number, said.since_ns
    if anew or record.generation != said.generation:
        record.start_channels(said.generation)
    record.told = record.told or Counts()
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


def _rows(told: link_pb2.MetricBatch) -> Iterable[tuple[int, int, float]]:
    """Series, stamp and value of each row; none where the columns do not fit."""
    count = told.count
    if (len(told.series_ids), len(told.stamps), len(told.values)) != (4 * count, 8 * count, 8 * count):
        return ()
    numbers = struct.unpack(f"<{count}I", told.series_ids)
    stamps = struct.unpack(f"<{count}q", told.stamps)
    return zip(numbers, stamps, struct.unpack(f"<{count}d", told.values), strict=True)


def _count(record: RobotRecord, told: cluster_pb2.TopicCount) -> None:
    state = record.channels.get(told.channel_id)
    if state is not None:
        state.received, state.received_bytes, state.lost = told.received, told.received_bytes, told.lost
        state.last_stamp_ns = told.last_stamp_ns if told.HasField("last_stamp_ns") else None
