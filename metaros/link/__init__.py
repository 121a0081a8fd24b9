"""The frames of the agent-gateway link: columns, chunks and the clock offset; both sides use the same code."""

from __future__ import annotations

from metaros.link.chunks import Reassembler, split_sample
from metaros.link.clock_offset import Beat, ClockOffset
from metaros.link.columns import (
    MetricColumns,
    SampleColumns,
    pack_batch,
    pack_metrics,
    unpack_batch,
    unpack_metrics,
)

__all__ = [
    "Beat",
    "ClockOffset",
    "MetricColumns",
    "Reassembler",
    "SampleColumns",
    "pack_batch",
    "pack_metrics",
    "split_sample",
    "unpack_batch",
    "unpack_metrics",
]
