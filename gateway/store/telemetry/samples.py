"""Queries for stored messages and their results: filters, runs, and a run's samples."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from gateway.domain.channel import Channel
from gateway.store.engine import Row, unsigned
from metaros.link import CHANNEL_MASK

__all__ = [
    "CHANNEL_COLUMNS",
    "RUN_COLUMNS",
    "ObjectLocation",
    "RunKey",
    "SampleFilter",
    "StoredBatch",
    "StoredRun",
    "stored_channel",
    "stored_run",
]

RunKey = tuple[int, int, int, int]  # first_ns (newest first: last_ns), stream_id, epoch, first_seq: a run's place


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleFilter:
    """Which runs are asked for; None asks for all. Stamps are the robot's; both ends are included.

    `after` is the `key` of the last run seen, in the order that is asked for: the runs that follow it.
    """

    topic: str | None = None
    topics: tuple[str, ...] | None = None
    stream_id: int | None = None
    epoch: int | None = None
    first_seq: int = 0
    start_ns: int | None = None
    end_ns: int | None = None
    after: RunKey | None = None


@dataclass(frozen=True, slots=True)
class ObjectLocation:
    """The location of a run in the object store: in one chunk of one object."""

    object_name: str
    chunk_start: int
    chunk_bytes: int
    offset: int  # of the run's first message record in the uncompressed chunk


@dataclass(frozen=True, slots=True, kw_only=True)
class StoredRun:
    """Consecutive samples of one stream and epoch that lie together: what there is, not yet what they say.

    It is a received batch (`place` is None) or lies in a segment. Stamps are the lowest and the highest of its samples;
    `size_bytes` counts payloads.
    """

    channel: Channel
    stream_id: int
    epoch: int
    first_seq: int
    count: int
    first_ns: int
    last_ns: int
    receive_ns: int
    stored_ns: int
    size_bytes: int
    place: ObjectLocation | None = None

    @property
    def last_seq(self) -> int:
        """The newest sample's number."""
        return self.first_seq + self.count - 1

    def key(self, *, newest_first: bool = False) -> RunKey:
        """Its place among the robot's runs in that order: what `SampleFilter.after` takes."""
        return (self.last_ns if newest_first else self.first_ns, self.stream_id, self.epoch, self.first_seq)


@dataclass(frozen=True, slots=True, eq=False)
class StoredBatch:
    """Consecutive samples of one stream and epoch, numbered from `first_seq`."""

    channel: Channel
    stream_id: int
    epoch: int
    first_seq: int
    receive_ns: int
    stored_ns: int
    stamps_ns: npt.NDArray[np.int64]
    lengths: npt.NDArray[np.uint32]
    payload: bytes

    @property
    def count(self) -> int:
        """How many samples."""
        return len(self.stamps_ns)

    @property
    def last_seq(self) -> int:
        """The newest sample's number."""
        return self.first_seq + self.count - 1

    def samples(self) -> Iterator[tuple[int, int, bytes]]:
        """(seq, stamp_ns, payload) of each."""
        end = 0
        for seq, (stamp_ns, length) in enumerate(
            zip(self.stamps_ns.tolist(), self.lengths.tolist(), strict=True), self.first_seq
        ):
            start, end = end, end + length
            yield seq, stamp_ns, self.payload[start:end]

    def cut(self, first_seq: int, count: int) -> StoredBatch:
        """`count` of its samples from number `first_seq` on; ValueError when it does not hold them all."""
        skip = first_seq - self.first_seq
        if skip < 0 or skip + count > self.count:
            raise ValueError(f"{first_seq} to {first_seq + count - 1} are not in {self.first_seq} to {self.last_seq}")
        if count == self.count:
            return self
        start = int(self.lengths[:skip].sum(dtype=np.int64))
        lengths = self.lengths[skip : skip + count]
        payload = self.payload[start : start + int(lengths.sum(dtype=np.int64))]
        stamps = self.stamps_ns[skip : skip + count]
        return replace(self, first_seq=first_seq, stamps_ns=stamps, lengths=lengths, payload=payload)


# What `stored_run` reads of a run `b`; a query appends size_bytes and the columns of the run's place.
RUN_COLUMNS = "b.channel, b.stream_id, b.epoch, b.first_seq, b.count, b.first_ns, b.last_ns, b.receive_ns, b.stored_ns"
CHANNEL_COLUMNS = (
    "c.channel, c.topic, c.schema_name, c.type_hash, c.encoding, c.schema_encoding, c.schema, c.qos, c.class,"
    " c.longest_ns"
)


def stored_channel(robot_id: str, row: Row) -> Channel:
    """A row of CHANNEL_COLUMNS; which number the robot's agent gave it is known of its runs only."""
    return Channel(
        robot=robot_id,
        channel_id=0,
        topic=row[1],
        schema_name=row[2],
        type_hash=row[3],
        encoding=row[4],
        schema_encoding=row[5],
        schema=bytes(row[6]),
        qos=row[7],
        delivery=row[8],
    )


def stored_run(channel: Channel, row: Row) -> StoredRun:
    """A row of RUN_COLUMNS, size_bytes, object, chunk_start, chunk_bytes, place; the object is None for a batch."""
    return StoredRun(
        channel=replace(channel, channel_id=row[1] & CHANNEL_MASK),
        stream_id=row[1],
        epoch=unsigned(row[2]),
        first_seq=row[3],
        count=row[4],
        first_ns=row[5],
        last_ns=row[6],
        receive_ns=row[7],
        stored_ns=row[8],
        size_bytes=row[9],
        place=ObjectLocation(*row[10:14]) if row[10] is not None else None,
    )
