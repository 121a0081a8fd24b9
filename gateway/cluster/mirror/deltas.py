"""What is told of a robot that is linked here: the news since it was told last, or all of it. Pure."""

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

__all__ = ["Schemas", "Told", "all_news_of", "digest_of", "news_of", "whole_of"]

DETAILS_S: Final = 1.0  # statistics and counts of topics are told at most so often
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


class Schemas:
    """The texts that the others were told, by their digests."""

    def __init__(self) -> None:
        self.texts: dict[bytes, bytes] = {}
        self._size_bytes = 0

    @property
    def full(self) -> bool:
        """Whether it is time to begin anew."""
        return len(self.texts) >= SCHEMAS or self._size_bytes >= SCHEMAS_BYTES

    def name(self, schema: bytes) -> tuple[bytes, bool]:
        """Its digest, and whether the others have to be told the text."""
        digest = digest_of(schema)
        if not digest or digest in self.texts:
            return digest, False
        self.texts[digest] = schema
        self._size_bytes += len(schema)
        return digest, True

    def copy(self) -> Schemas:
        """The same texts."""
        same = Schemas()
        same.texts, same._size_bytes = dict(self.texts), self._size_bytes
        return same


@dataclass(slots=True)
class Told:
    """What the others know of a robot that is linked here."""

    since: tuple[int, int, int] = (0, 0, 0)  # session number, generation of its channels, since when
    robot: Robot | None = None
    channels: dict[int, Channel] = field(default_factory=dict)
    numbers: dict[str, int] = field(default_factory=dict)  # of series
    series: int = 0  # so many of these were told
    revision: int = 0
    statistics: link_pb2.TopicStatistics | None = None
    counts: dict[int, tuple[int, int, int | None]] = field(default_factory=dict)
    details_s: float = float("-inf")
    detailed: int = 0  # the revision of which statistics and counts of topics were told


def news_of(
    record: RobotRecord,
    told: Told,
    schemas: Schemas,
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
    if told.robot is not record.robot or told.since != since:
        if told.since[1] != record.generation:
            told.channels, told.counts = {}, {}
        told.robot, told.since = record.robot, since
        piece.introduction.CopyFrom(_introduction(record))
    if announced:
        for channels, texts in _channels(_new_channels(record, told), schemas):
            piece.channels.extend(channels)
            yield piece, texts
            piece = cluster_pb2.MirroredRobot(robot=robot)
    for some in _new_series(record, told, [*record.series, *values] if announced else values):
        piece.series.extend(some)
        yield piece, []
        piece = cluster_pb2.MirroredRobot(robot=robot)
    _add_values(piece, told, values)
    if look and told.revision != record.revision:
        told.revision = record.revision
        _add_state(piece, record, now_s=now_s)
    if look and told.detailed != record.revision and now_s - told.details_s >= DETAILS_S:
        told.details_s, told.detailed = now_s, record.revision
        _add_details(piece, record, told)
    if len(piece.ListFields()) > 1:  # more than whose it is
        yield piece, []


def all_news_of(record: RobotRecord, told: Told, schemas: Schemas, *, now_s: float) -> Iterator[Piece]:
    """Everything, of a robot of which nobody was told yet."""
    return news_of(record, told, schemas, values=record.newest(), now_s=now_s, announced=True, look=True)


def whole_of(record: RobotRecord, told: Told, schemas: Schemas, *, now_s: float) -> Iterator[Piece]:
    """Everything, for somebody who knows nothing; series have the numbers that the others know."""
    return all_news_of(record, Told(numbers=told.numbers), schemas, now_s=now_s)


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


def _channels(new: Iterable[Channel], schemas: Schemas) -> Iterator[tuple[list[link_pb2.Channel], list[bytes]]]:
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


def _new_channels(record: RobotRecord, told: Told) -> list[Channel]:
    known, channels = told.channels, [state.channel for state in record.channels.values()]
    new = [channel for channel in channels if known.get(channel.channel_id) != channel]
    known.update((channel.channel_id, channel) for channel in new)
    return new


def _new_series(record: RobotRecord, told: Told, names: Iterable[str]) -> Iterator[list[link_pb2.Series]]:
    """Those of these names without a number get one; all that were not told yet, in pieces that are not too large."""
    for name in names:
        told.numbers.setdefault(name, len(told.numbers) + 1)
    if told.series == len(told.numbers):
        return
    new = list(told.numbers.items())[told.series :]
    told.series = len(told.numbers)
    for start in range(0, len(new), SERIES_AT_ONCE):
        yield [_wire_series(name, number, record) for name, number in new[start : start + SERIES_AT_ONCE]]


def _wire_series(name: str, number: int, record: RobotRecord) -> link_pb2.Series:
    state = record.series.get(name)
    if state is None:
        return link_pb2.Series(series_id=number, name=name)
    return link_pb2.Series(series_id=number, name=name, topic=state.series.topic, field=state.series.field)


def _add_values(piece: cluster_pb2.MirroredRobot, told: Told, values: Mapping[str, tuple[int, float]]) -> None:
    known = [(number, *value) for name, value in values.items() if (number := told.numbers.get(name)) is not None]
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


def _add_details(piece: cluster_pb2.MirroredRobot, record: RobotRecord, told: Told) -> None:
    if record.statistics is not told.statistics:
        told.statistics = record.statistics
        piece.statistics.CopyFrom(record.statistics)
    for number, state in record.channels.items():
        now = (state.received, state.lost, state.last_stamp_ns)
        if told.counts.get(number, (0, 0, None)) != now:
            told.counts[number] = now
            count = piece.counts.add(
                channel_id=number, received=state.received, received_bytes=state.received_bytes, lost=state.lost
            )
            if state.last_stamp_ns is not None:
                count.last_stamp_ns = state.last_stamp_ns
