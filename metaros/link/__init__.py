"""The frames of the agent-gateway link: columns, chunks and the clock offset; both sides use the same code."""

from __future__ import annotations

from metaros.link.chunks import Reassembler, split_sample
from metaros.link.clock_offset import Beat, ClockOffset
from metaros.link.columns import (
    BACKFILL_BIT,
    CHANNEL_MASK,
    MetricColumns,
    SampleColumns,
    pack_batch,
    pack_metrics,
    unpack_batch,
    unpack_metrics,
)
from metaros.link.compression import compress, decompress
from metaros.link.packed_frames import batch_bytes, batches_frame, metrics_frame

__all__ = [
    "BACKFILL_BIT",
    "CHANNEL_MASK",
    "Beat",
    "ClockOffset",
    "MetricColumns",
    "Reassembler",
    "SampleColumns",
    "batch_bytes",
    "batches_frame",
    "compress",
    "decompress",
    "metrics_frame",
    "pack_batch",
    "pack_metrics",
    "split_sample",
    "unpack_batch",
    "unpack_metrics",
]
