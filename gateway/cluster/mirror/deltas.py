"""Messages about a local robot for other gateways: a delta since the last one, or a snapshot. Pure."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from hashlib import blake2b
from typing import Final

from gateway.domain.channel import CLASSES, Channel
from gateway.domain.robot import Robot
from gateway.ingest.registry import RobotRecord
from metaros._proto import cluster_pb2, link_pb2

__all__ = ["SentSchemas", "SentState", "delta_of", "digest_of", "first_snapshot_of", "snapshot_of"]

DETAILS_S: Final = 1.0  # statistics and counts of topics are sent at most so often
CHANNELS_AT_ONCE: Final = 64  # in one piece
SERIES_AT_ONCE: Final = 256
PIECE_BYTES: Final = 256 * 1024  # of schemas in one piece, or one schema that is larger
SCHEMAS: Final = 65_536
SCHEMAS_BYTES: Final = 64 * 1024 * 1024
_NUMBER_OF_CLASS: Final = {name: number for number, name in CLASSES.items()}

Piece = tuple[cluster_pb2.MirroredRobot, list[bytes]]  # and the texts of schemas that it is the first to name


def digest_of(schema: bytes) -> bytes:
    """What a channel names its schema by; b"" has none."""
    return blake2b(schema, digest_size=16).digest() if schema else b""


class SentSchemas:
    """The schema texts that were sent to the others, by their digests."""

    def __init__(self) -> None:
        self.texts: dict[bytes, bytes] = {}
        self._size_bytes = 0

    @property
    def full(self) -> bool:
        """Whether it is time to begin anew."""
        return len(self.texts) >= SCHEMAS or self._size_bytes >= SCHEMAS_BYTES

    def name(self, schema: bytes) -> tuple[bytes, bool]:
        """Its digest, and whether the text still has to be sent."""
        digest = digest_of(schema)
        if not digest or digest in self.texts:
            return digest, False
        self.texts[digest] = schema
        self._size_bytes += len(schema)
        return digest, True

    def copy(self) -> SentSchemas:
        """The same texts."""
        same = SentSchemas()
        same.texts, same._size_bytes = dict(self.texts), self._size_bytes
        return same


@dataclass(slots=True)
class SentState:
    """What the others know of a robot that is linked here."""

    since: tuple[int, int, int] = (0, 0, 0)  # session number, generation of its channels, since when
    robot: Robot | None = None
    channels: dict[int, Channel] = field(default_factory=dict)
    numbers: dict[str, int] = field(default_factory=dict)  # of series
    series: int = 0  # so many of these were sent
    revision: int = 0
    statistics: link_pb2.TopicStatistics | None = None
    counts: dict[int, tuple[int, int, int | None]] = field(default_factory=dict)
    details_s: float = float("-inf")
    detailed: int = 0  # the revision of which statistics and counts of topics were told


def delta_of(
    record: RobotRecord,
    sent: SentState,
    schemas: SentSchemas,
    *,
    values: Mapping[str, tuple[int, float]],
    now_s: float,
    announced: bool,
    look: bool,
) -> Iterator[Piece]:
    """What has changed since: `values`; where `announced`, channels and series; and where `look`, counts."""
    robot = record.robot.id
    piece = cluster_pb2.MirroredRobot(robot=robot)
    since = (record.session_number, record.generation, record.since_ns)
    if sent.robot is not record.robot or sent.since != since:
        if sent.since[1] != record.generation:
            sent.channels, sent.counts = {}, {}
        sent.robot, sent.since = record.robot, since
        piece.introduction.CopyFrom(_introduction(record))
    if announced:
        for channels, texts in _channels(_new_channels(record, sent), schemas):
            piece.channels.extend(channels)
            yield piece, texts
            piece = cluster_pb2.MirroredRobot(robot=robot)
    for some in _new_series(record, sent, [*record.series, *values] if announced else values):
        piece.series.extend(some)
        yield piece, []
        piece = cluster_pb2.MirroredRobot(robot=robot)
    _add_values(piece, sent, values)
    if look and sent.revision != record.revision:
        sent.revision = record.revision
        _add_state(piece, record, now_s=now_s)
    if look and sent.detailed != record.revision and now_s - sent.details_s >= DETAILS_S:
        sent.details_s, sent.detailed = now_s, record.revision
        _add_details(piece, record, sent)
    if len(piece.ListFields()) > 1:  # more than whose it is
        yield piece, []


def first_snapshot_of(record: RobotRecord, sent: SentState, schemas: SentSchemas, *, now_s: float) -> Iterator[Piece]:
    """The first snapshot of a robot, for everybody."""
    return delta_of(record, sent, schemas, values=record.newest(), now_s=now_s, announced=True, look=True)


def snapshot_of(record: RobotRecord, sent: SentState, schemas: SentSchemas, *, now_s: float) -> Iterator[Piece]:
    """Everything, for somebody who knows nothing; series have the numbers that the others know."""
    return first_snapshot_of(record, SentState(numbers=sent.numbers), schemas, now_s=now_s)


def _introduction(record: RobotRecord) -> cluster_pb2.Introduction:
    robot = record.robot
    return cluster_pb2.Introduction(
        session_number=record.session_number,
        namespace=robot.namespace,
        hostname=robot.hostname,
        agent_version=robot.agent_version,
        labels=dict(robot.labels),
        since_ns=record.since_ns,
        generation=record.generation,
    )


def _channels(new: Iterable[Channel], schemas: SentSchemas) -> Iterator[tuple[list[link_pb2.Channel], list[bytes]]]:
    """In pieces that are not too large."""
    channels: list[link_pb2.Channel] = []
    texts: list[bytes] = []
    size_bytes = 0
    for channel in new:
        digest, first = schemas.name(channel.schema)
        if channels and (len(channels) >= CHANNELS_AT_ONCE or size_bytes + len(channel.schema) > PIECE_BYTES):
            yield channels, texts
            channels, texts, size_bytes = [], [], 0
        if first:
            texts.append(channel.schema)
            size_bytes += len(channel.schema)
        channels.append(_wire_channel(channel, digest))
    if channels:
        yield channels, texts


def _wire_channel(channel: Channel, digest: bytes) -> link_pb2.Channel:
    wire = link_pb2.Channel(
        channel_id=channel.channel_id,
        topic=channel.topic,
        encoding=channel.encoding,
        schema_name=channel.schema_name,
        schema_encoding=channel.schema_encoding,
        schema=digest,
        type_hash=channel.type_hash,
        qos=channel.qos,
        max_rate_hz=channel.max_rate_hz,
        forward=channel.forward,
        history=channel.history,
        history_rate_hz=channel.history_rate_hz,
    )
    setattr(wire, "class", _NUMBER_OF_CLASS[channel.delivery])
    return wire


def _new_channels(record: RobotRecord, sent: SentState) -> list[Channel]:
    known, channels = sent.channels, [state.channel for state in record.channels.values()]
    new = [channel for channel in channels if known.get(channel.channel_id) != channel]
    known.update((channel.channel_id, channel) for channel in new)
    return new


def _new_series(record: RobotRecord, sent: SentState, names: Iterable[str]) -> Iterator[list[link_pb2.Series]]:
    """Those of these names without a number get one; all that were not told yet, in pieces that are not too large."""
    for name in names:
        sent.numbers.setdefault(name, len(sent.numbers) + 1)
    if sent.series == len(sent.numbers):
        return
    new = list(sent.numbers.items())[sent.series :]
    sent.series = len(sent.numbers)
    for start in range(0, len(new), SERIES_AT_ONCE):
        yield [_wire_series(name, number, record) for name, number in new[start : start + SERIES_AT_ONCE]]


def _wire_series(name: str, number: int, record: RobotRecord) -> link_pb2.Series:
    state = record.series.get(name)
    if state is None:
        return link_pb2.Series(series_id=number, name=name)
    return link_pb2.Series(series_id=number, name=name, topic=state.series.topic, field=state.series.field)


def _add_values(piece: cluster_pb2.MirroredRobot, sent: SentState, values: Mapping[str, tuple[int, float]]) -> None:
    known = [(number, *value) for name, value in values.items() if (number := sent.numbers.get(name)) is not None]
    if not known:
        return
    numbers, stamps, plain = zip(*known, strict=True)
    count = len(known)
    piece.values.count = count
    piece.values.series_ids = struct.pack(f"<{count}I", *numbers)
    piece.values.stamps = struct.pack(f"<{count}q", *stamps)
    piece.values.values = struct.pack(f"<{count}d", *plain)


def _add_state(piece: cluster_pb2.MirroredRobot, record: RobotRecord, *, now_s: float) -> None:
    counts, state = record.counts, piece.state
    state.last_seen_ns = record.last_seen_ns
    state.bytes_per_s = record.byte_rate.read(now_s)
    if record.rtt_s is not None:
        state.rtt_s = record.rtt_s
    if record.lag_ns is not None:
        state.lag_ns = record.lag_ns
    state.samples, state.bytes, state.duplicates = counts.samples, counts.bytes, counts.duplicates
    state.gaps, state.lost = counts.gaps, counts.lost
    state.over_quota, state.put_off = counts.over_quota, counts.put_off
    state.forks, state.epochs = record.forks, record.epochs


def _add_details(piece: cluster_pb2.MirroredRobot, record: RobotRecord, sent: SentState) -> None:
    if record.statistics is not sent.statistics:
        sent.statistics = record.statistics
        piece.statistics.CopyFrom(record.statistics)
    for number, state in record.channels.items():
        now = (state.received, state.lost, state.last_stamp_ns)
        if sent.counts.get(number, (0, 0, None)) != now:
            sent.counts[number] = now
            count = piece.counts.add(
                channel_id=number, received=state.received, received_bytes=state.received_bytes, lost=state.lost
            )
            if state.last_stamp_ns is not None:
                count.last_stamp_ns = state.last_stamp_ns
