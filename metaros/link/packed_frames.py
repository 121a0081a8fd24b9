"""Link frames from columns that are already packed: header fields are written in front, the rest is copied.

Protocol Buffers let a message be made of pieces: the serialised fields of one, one after the other, are its bytes.
"""

from __future__ import annotations

from collections.abc import Iterable

from metaros._proto import link_pb2

__all__ = ["batch_bytes", "batches_frame", "metrics_frame"]

_BATCHES_TAG = b"\x1a"  # AgentFrame.batches, length-delimited
_METRICS_TAG = b"\x22"  # AgentFrame.metrics
_BATCH_TAG = b"\x0a"  # Batches.batches


def batch_bytes(columns: bytes, *, stream_id: int, epoch: int, first_seq: int, count: int) -> bytes:
    """A serialised Batch whose `stamps`, `lengths` and `payload` are in `columns`."""
    head = link_pb2.Batch(stream_id=stream_id, epoch=epoch, first_seq=first_seq, count=count)
    return head.SerializeToString() + columns


def batches_frame(batches: Iterable[bytes]) -> bytes:
    """A serialised AgentFrame of serialised Batches."""
    pieces = [piece for batch in batches for piece in (_BATCH_TAG, varint(len(batch)), batch)]
    return b"".join((_BATCHES_TAG, varint(sum(map(len, pieces))), *pieces))


def metrics_frame(columns: bytes, *, stream_id: int, epoch: int, first_seq: int, count: int) -> bytes:
    """A serialised AgentFrame of one MetricBatch whose columns are in `columns`."""
    head = link_pb2.MetricBatch(stream_id=stream_id, epoch=epoch, first_seq=first_seq, count=count).SerializeToString()
    return b"".join((_METRICS_TAG, varint(len(head) + len(columns)), head, columns))


def varint(value: int) -> bytes:
    """A non-negative number as Protocol Buffers write lengths: seven bits a byte, lowest first."""
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
