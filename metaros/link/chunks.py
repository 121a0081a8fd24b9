"""Large samples in pieces: a sample that is over a batch's limit travels as several Batches of one stream.

The pieces of a sample are sent in order and nothing of the same stream comes between them; other streams may. A lane
has one Reassembler, dropped with the lane: pieces never outlive a connection.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.lazy_import import LazyModule
from metaros.limits import LIMITS, Limits
from metaros.link.columns import CHANNEL_MASK, LENGTH, STAMP, SampleColumns, check_run, column, unpack_batch

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")

__all__ = ["Reassembler", "split_sample"]


def split_sample(
    stream_id: int, epoch: int, seq: int, stamp_ns: int, payload: bytes, *, limits: Limits = LIMITS
) -> Iterator[link_pb2.Batch]:
    """The Batches of one sample: one if it fits a batch, else pieces of `limits.chunk_bytes`."""
    pieces = 1 if len(payload) <= limits.batch_bytes else -(-len(payload) // limits.chunk_bytes)
    size = len(payload) if pieces == 1 else limits.chunk_bytes
    for index in range(pieces):
        yield link_pb2.Batch(
            stream_id=stream_id,
            epoch=epoch,
            first_seq=seq,
            count=1,
            stamps=struct.pack("<q", stamp_ns),
            lengths=struct.pack("<I", len(payload)),
            payload=payload[index * size : (index + 1) * size],
            chunk_index=index if pieces > 1 else 0,
            chunk_count=pieces if pieces > 1 else 0,
        )


@dataclass(slots=True, kw_only=True)
class _Partial:
    """What has come of one sample so far."""

    epoch: int
    seq: int
    stamp_ns: int
    size_bytes: int
    chunk_count: int
    pieces: int = 0
    data: bytearray = field(default_factory=bytearray)


class Reassembler:
    """Puts the pieces of large samples together again; whole batches pass straight through.

    Memory is bounded by `max_bytes` of announced sample sizes, counted when a sample's first piece comes.
    """

    def __init__(self, *, max_bytes: int = 4 * LIMITS.sample_bytes, limits: Limits = LIMITS) -> None:
        self._limits = limits
        self._max_bytes = max_bytes
        self._partials: dict[int, _Partial] = {}
        self._pending_bytes = 0

    @property
    def pending_bytes(self) -> int:
        """Announced sizes of the samples that are still incomplete."""
        return self._pending_bytes

    def feed(self, batch: link_pb2.Batch) -> SampleColumns | None:
        """The batch's columns, or None while a large sample is incomplete.

        Raises:
            FrameError: the batch or the order of pieces breaks the protocol.
        """
        partial = self._partials.get(batch.stream_id)
        if batch.chunk_count <= 1:
            if partial is not None:
                raise FrameError(f"stream {batch.stream_id}: a batch in the middle of a sample's pieces")
            return unpack_batch(batch, limits=self._limits)
        if partial is None:
            partial = self._begin(batch)
        return self._append(partial, batch)

    def _begin(self, batch: link_pb2.Batch) -> _Partial:
        if batch.stream_id & CHANNEL_MASK == 0:
            raise FrameError("stream 0 carries metrics, not samples")
        check_run(batch.first_seq, batch.count, self._limits)
        if batch.count != 1:
            raise FrameError(f"a chunk belongs to exactly one sample, not {batch.count}")
        size_bytes = int(column(batch.lengths, LENGTH, 1, "lengths")[0])
        if size_bytes > self._limits.sample_bytes:
            raise FrameError(f"a sample of {size_bytes} bytes is over the limit of {self._limits.sample_bytes}")
        if self._pending_bytes + size_bytes > self._max_bytes:
            raise FrameError(f"more than {self._max_bytes} bytes of incomplete samples")
        partial = _Partial(
            epoch=batch.epoch,
            seq=batch.first_seq,
            stamp_ns=int(column(batch.stamps, STAMP, 1, "stamps")[0]),
            size_bytes=size_bytes,
            chunk_count=batch.chunk_count,
        )
        self._partials[batch.stream_id] = partial
        self._pending_bytes += size_bytes
        return partial

    def _append(self, partial: _Partial, batch: link_pb2.Batch) -> SampleColumns | None:
        expected = (partial.epoch, partial.seq, partial.chunk_count, partial.pieces)
        if (batch.epoch, batch.first_seq, batch.chunk_count, batch.chunk_index) != expected or batch.count != 1:
            raise FrameError(f"stream {batch.stream_id}: a sample's pieces are out of order")
        if not 1 <= len(batch.payload) <= self._limits.chunk_bytes:
            raise FrameError(f"a chunk holds 1 to {self._limits.chunk_bytes} bytes, not {len(batch.payload)}")
        if int(column(batch.lengths, LENGTH, 1, "lengths")[0]) != partial.size_bytes:
            raise FrameError(f"stream {batch.stream_id}: a sample's pieces disagree about its size")
        if len(partial.data) + len(batch.payload) > partial.size_bytes:
            raise FrameError(f"a sample's pieces make more than the {partial.size_bytes} bytes that were announced")
        partial.data += batch.payload
        partial.pieces += 1
        if partial.pieces < partial.chunk_count:
            return None
        del self._partials[batch.stream_id]
        self._pending_bytes -= partial.size_bytes
        payload = bytes(partial.data)
        if len(payload) != partial.size_bytes:
            raise FrameError(f"a sample's pieces make {len(payload)} bytes, announced were {partial.size_bytes}")
        return SampleColumns(
            stream_id=batch.stream_id,
            epoch=partial.epoch,
            first_seq=partial.seq,
            stamps_ns=np.asarray([partial.stamp_ns], np.int64),
            offsets=np.asarray([0, len(payload)], np.int64),
            payload=payload,
        )
