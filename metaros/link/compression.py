"""Compression of a Batch's payload: zstd where it saves a tenth, and expansion that cannot be made to fill memory."""

from __future__ import annotations

from typing import TYPE_CHECKING

from metaros._proto import link_pb2
from metaros.errors import FrameError
from metaros.lazy_import import LazyModule
from metaros.limits import LIMITS, Limits

if TYPE_CHECKING:
    import numpy as np
    import zstandard
else:
    np, zstandard = LazyModule("numpy"), LazyModule("zstandard")

__all__ = ["compress", "decompress"]

_LEAST_BYTES = 256
_LEVEL = 1
_MAX_RATIO = 100


def compress(columns: bytes, compression: str) -> bytes:
    """The columns of a Batch with their payload compressed, or as they are where that saves less than a tenth."""
    if compression == "none" or len(columns) < _LEAST_BYTES:
        return columns
    batch = link_pb2.Batch.FromString(columns)
    small = zstandard.ZstdCompressor(level=_LEVEL).compress(batch.payload)
    if len(small) > 0.9 * len(batch.payload) or len(batch.payload) > _MAX_RATIO * len(small):
        return columns
    batch.payload, batch.compression = small, link_pb2.COMPRESSION_ZSTD
    return batch.SerializeToString()


def decompress(batch: link_pb2.Batch, *, limits: Limits = LIMITS) -> link_pb2.Batch:
    """The batch with its payload as it was.

    Raises:
        FrameError: an unknown compression, a size that `lengths` does not announce, or a bomb.
    """
    if batch.compression == link_pb2.COMPRESSION_NONE:
        return batch
    if batch.compression != link_pb2.COMPRESSION_ZSTD or batch.chunk_count:
        raise FrameError(f"compression {batch.compression} is not known, or not allowed on a chunk")
    if len(batch.lengths) % 4:
        raise FrameError(f"column lengths has {len(batch.lengths)} bytes")
    size = int(np.frombuffer(batch.lengths, "<u4").sum(dtype=np.int64))
    if size > limits.sample_bytes or size > _MAX_RATIO * max(len(batch.payload), 1):
        raise FrameError(f"{len(batch.payload)} compressed bytes cannot become {size}")
    try:
        if zstandard.frame_content_size(batch.payload) not in (-1, size):  # it would be believed, whatever the bound
            raise FrameError(f"a compressed payload says that it is not the {size} bytes that its lengths add up to")
        payload = zstandard.ZstdDecompressor(max_window_size=1 << 25).decompress(
            batch.payload, max_output_size=max(size, 1)
        )
    except zstandard.ZstdError as error:
        raise FrameError(f"a compressed payload is damaged: {error}") from None
    if len(payload) != size:
        raise FrameError(f"a compressed payload has {len(payload)} bytes, its lengths add up to {size}")
    whole = link_pb2.Batch()
    whole.CopyFrom(batch)
    whole.payload, whole.compression = payload, link_pb2.COMPRESSION_NONE
    return whole
