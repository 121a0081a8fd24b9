"""Reading messages back: the batches of a robot's topic or stream, as they were stored."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from gateway.domain.channel import Channel
from gateway.store.engine import StoreEngine, signed, unsigned
from metaros.link import CHANNEL_MASK

__all__ = ["SampleFilter", "StoredBatch", "read_samples"]


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleFilter:
    """Which batches are asked for; None asks for all. Stamps are the robot's; both ends are included."""

    topic: str | None = None
    stream_id: int | None = None
    epoch: int | None = None
    first_seq: int = 0
    start_ns: int | None = None
    end_ns: int | None = None


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


def read_samples(engine: StoreEngine, robot_id: str, wanted: SampleFilter, *, limit: int) -> list[StoredBatch]:
    """The robot's batches that hold anything of what is wanted, at most `limit`, by stream, epoch and number."""
    conditions: list[tuple[str, Any]] = [("r.id = ?", robot_id)]
    if wanted.topic is not None:
        conditions.append(("c.topic = ?", wanted.topic))
    if wanted.stream_id is not None:
        conditions.append(("b.stream_id = ?", wanted.stream_id))
    if wanted.epoch is not None:
        conditions.append(("b.epoch = ?", signed(wanted.epoch)))
    if wanted.first_seq:
        conditions.append(("b.first_seq + b.count > ?", wanted.first_seq))
    if wanted.start_ns is not None:
        conditions.append(("b.last_ns >= ?", wanted.start_ns))
    if wanted.end_ns is not None:
        conditions.append(("b.first_ns <= ?", wanted.end_ns))
    query = (
        "SELECT c.topic, c.schema_name, c.type_hash, c.encoding, c.schema_encoding, c.schema, c.qos, c.class,"
        " b.stream_id, b.epoch, b.first_seq, b.receive_ns, b.stored_ns, b.stamps, b.lengths, b.payload"
        " FROM sample_batches b JOIN channels c ON c.channel = b.channel JOIN robots r ON r.robot = b.robot"
        f" WHERE {' AND '.join(condition for condition, _ in conditions)}"
        " ORDER BY b.stream_id, b.epoch, b.first_seq LIMIT ?"
    )
    with engine.transaction(write=False):
        rows = engine.fetch(query, *(value for _, value in conditions), limit)
    return [_batch(robot_id, row) for row in rows]


def _batch(robot_id: str, row: Any) -> StoredBatch:
    channel = Channel(
        robot=robot_id,
        channel_id=row[8] & CHANNEL_MASK,
        topic=row[0],
        schema_name=row[1],
        type_hash=row[2],
        encoding=row[3],
        schema_encoding=row[4],
        schema=bytes(row[5]),
        qos=row[6],
        delivery=row[7],
    )
    stamps, lengths = np.frombuffer(row[13], np.int64), np.frombuffer(row[14], np.dtype("<u4"))
    return StoredBatch(channel, row[8], unsigned(row[9]), row[10], row[11], row[12], stamps, lengths, bytes(row[15]))
