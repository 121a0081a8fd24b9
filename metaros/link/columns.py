"""Batches as columns: samples and metric rows to and from link frames, checked before anybody trusts them.

Packing joins what the agent holds; unpacking gives views into the frame and copies nothing. Every rule of a batch
(counts, column lengths, size limits) is checked here, so that a bad frame is a FrameError and nothing else.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.lazy_import import LazyModule
from metaros.limits import LIMITS, Limits

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
else:
    np = LazyModule("numpy")  # who only packs, as an agent, does without it

__all__ = [
    "BACKFILL_BIT",
    "CHANNEL_MASK",
    "MetricColumns",
    "SampleColumns",
    "pack_batch",
    "pack_metrics",
    "unpack_batch",
    "unpack_metrics",
]

STAMP, LENGTH, SERIES, VALUE = "<i8", "<u4", "<u4", "<f8"
BACKFILL_BIT = 1 << 31  # in the id of a stream of the back-fill lane; the rest is its channel's
CHANNEL_MASK = BACKFILL_BIT - 1
MAX_SEQ = 2**63 - 1  # fits SQL's signed integers


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class SampleColumns:
    """Samples first_seq .. first_seq+count-1 of one stream; `offsets` has count+1 entries into `payload`."""

    stream_id: int
    epoch: int
    first_seq: int
    stamps_ns: npt.NDArray[np.int64]
    offsets: npt.NDArray[np.int64]
    payload: bytes

    @property
    def count(self) -> int:
        """How many samples."""
        return len(self.stamps_ns)

    @property
    def last_seq(self) -> int:
        """The newest sample's number."""
        return self.first_seq + self.count - 1

    def samples(self) -> Iterator[tuple[int, int, memoryview]]:
        """(seq, stamp_ns, bytes) of each sample; the bytes are views that keep the frame alive."""
        view = memoryview(self.payload)
        bounds = self.offsets.tolist()
        for index, stamp_ns in enumerate(self.stamps_ns.tolist()):
            yield self.first_seq + index, stamp_ns, view[bounds[index] : bounds[index + 1]]

    def after(self, skip: int) -> SampleColumns:
        """The columns without their first `skip` samples."""
        if skip == 0:
            return self
        offsets = self.offsets[skip:]
        return SampleColumns(
            stream_id=self.stream_id,
            epoch=self.epoch,
            first_seq=self.first_seq + skip,
            stamps_ns=self.stamps_ns[skip:],
            offsets=offsets - offsets[0],
            payload=self.payload[int(offsets[0]) :],
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class MetricColumns:
    """Rows first_seq .. first_seq+count-1 of a robot's metric stream."""

    epoch: int
    first_seq: int
    series_ids: npt.NDArray[np.uint32]
    stamps_ns: npt.NDArray[np.int64]
    values: npt.NDArray[np.float64]
    stream_id: int = 0

    @property
    def count(self) -> int:
        """How many rows."""
        return len(self.values)

    @property
    def last_seq(self) -> int:
        """The newest row's number."""
        return self.first_seq + self.count - 1


def pack_batch(
    stream_id: int, epoch: int, first_seq: int, stamps_ns: Sequence[int], payloads: Sequence[bytes]
) -> link_pb2.Batch:
    """One Batch frame of consecutive samples; the caller keeps it within `LIMITS` (see `metaros.link.chunks`)."""
    if len(stamps_ns) != len(payloads):
        raise FrameError(f"{len(stamps_ns)} stamps for {len(payloads)} samples")
    return link_pb2.Batch(
        stream_id=stream_id,
        epoch=epoch,
        first_seq=first_seq,
        count=len(payloads),
        stamps=struct.pack(f"<{len(stamps_ns)}q", *stamps_ns),
        lengths=struct.pack(f"<{len(payloads)}I", *map(len, payloads)),
        payload=b"".join(payloads),
    )


def pack_metrics(
    epoch: int, first_seq: int, series_ids: Sequence[int], stamps_ns: Sequence[int], values: Sequence[float]
) -> link_pb2.MetricBatch:
    """One MetricBatch frame of consecutive rows."""
    if not len(series_ids) == len(stamps_ns) == len(values):
        raise FrameError(f"columns differ: {len(series_ids)} series, {len(stamps_ns)} stamps, {len(values)} values")
    return link_pb2.MetricBatch(
        epoch=epoch,
        first_seq=first_seq,
        count=len(values),
        series_ids=np.asarray(series_ids, SERIES).tobytes(),
        stamps=np.asarray(stamps_ns, STAMP).tobytes(),
        values=np.asarray(values, VALUE).tobytes(),
    )


def unpack_batch(batch: link_pb2.Batch, *, limits: Limits = LIMITS) -> SampleColumns:
    """The columns of a whole (unchunked) Batch.

    Raises:
        FrameError: a count, a column's length, a number or a size is not what the protocol allows.
    """
    if batch.chunk_count > 1:
        raise FrameError("a chunk of a sample is no whole batch")
    if batch.stream_id & CHANNEL_MASK == 0:
        raise FrameError("stream 0 carries metrics, not samples")
    check_run(batch.first_seq, batch.count, limits)
    stamps_ns = column(batch.stamps, STAMP, batch.count, "stamps")
    lengths = column(batch.lengths, LENGTH, batch.count, "lengths")
    offsets = np.zeros(batch.count + 1, np.int64)
    lengths.cumsum(dtype=np.int64, out=offsets[1:])  # np.cumsum takes as long again to find this
    if int(offsets[-1]) != len(batch.payload):
        raise FrameError(f"lengths add up to {int(offsets[-1])} bytes, the payload has {len(batch.payload)}")
    if len(batch.payload) > (limits.sample_bytes if batch.count == 1 else limits.batch_bytes):
        raise FrameError(f"a batch of {batch.count} samples with {len(batch.payload)} bytes is over the limit")
    return SampleColumns(
        stream_id=batch.stream_id,
        epoch=batch.epoch,
        first_seq=batch.first_seq,
        stamps_ns=stamps_ns,
        offsets=offsets,
        payload=batch.payload,
    )


def unpack_metrics(batch: link_pb2.MetricBatch, *, limits: Limits = LIMITS) -> MetricColumns:
    """The columns of a MetricBatch.

    Raises:
        FrameError: a count, a column's length or a number is not what the protocol allows.
    """
    if batch.stream_id & CHANNEL_MASK:
        raise FrameError(f"stream {batch.stream_id} carries samples, not metrics")
    check_run(batch.first_seq, batch.count, limits)
    series_ids = column(batch.series_ids, SERIES, batch.count, "series_ids")
    if not series_ids.all():
        raise FrameError("series ids start at 1")
    return MetricColumns(
        epoch=batch.epoch,
        first_seq=batch.first_seq,
        series_ids=series_ids,
        stamps_ns=column(batch.stamps, STAMP, batch.count, "stamps"),
        values=column(batch.values, VALUE, batch.count, "values"),
        stream_id=batch.stream_id,
    )


def check_run(first_seq: int, count: int, limits: Limits) -> None:
    """Refuse a run of sequence numbers that is empty, too long or out of range."""
    if not 1 <= count <= limits.batch_samples:
        raise FrameError(f"a batch holds 1 to {limits.batch_samples} samples, not {count}")
    if not 1 <= first_seq <= MAX_SEQ - count:
        raise FrameError(f"sequence number {first_seq} is out of range")


def column(data: bytes, dtype: str, count: int, name: str) -> npt.NDArray[Any]:
    """A read-only view of `count` little-endian values."""
    size = count * int(dtype[-1])
    if len(data) != size:
        raise FrameError(f"column {name} has {len(data)} bytes, {count} values need {size}")
    return np.frombuffer(data, dtype)
