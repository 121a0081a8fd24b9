"""The message records of a segment's chunk: packed from many batches at once, and compared with what they should be."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from gateway.store.telemetry.samples import StoredBatch

__all__ = ["RECORD_BYTES", "Messages", "holds", "joined", "pack_records"]

_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_ns", "<u8"),
        ("publish_ns", "<u8"),
    ]
)
RECORD_BYTES = _HEAD.itemsize  # what a record has beside its message
_OPCODE, _FIXED = 5, RECORD_BYTES - 9  # _FIXED: of what a record says of its length

Integers = npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Messages:
    """Messages of one stream as columns."""

    numbers: Integers
    stamps_ns: Integers
    lengths: Integers
    payload: bytes


def joined(batches: Sequence[StoredBatch]) -> Messages:
    """All messages of some batches, of which there is at least one."""
    counts = [batch.count for batch in batches]
    before: Integers = np.cumsum(counts, dtype=np.int64) - counts
    numbers: Integers = np.repeat(np.array([batch.first_seq for batch in batches], np.int64) - before, counts)
    return Messages(
        numbers + np.arange(len(numbers), dtype=np.int64),
        np.concatenate([batch.stamps_ns for batch in batches]),
        np.concatenate([batch.lengths for batch in batches]).astype(np.int64),
        b"".join([batch.payload for batch in batches]),
    )


def pack_records(channel_id: int, messages: Messages) -> tuple[bytes, Integers]:
    """The records of messages, one after the other, and where each begins."""
    heads, data = memoryview(_heads(channel_id, messages)), memoryview(messages.payload)
    parts: list[memoryview] = []
    at = place = 0
    for length in messages.lengths.tolist():
        parts += (heads[place : place + RECORD_BYTES], data[at : at + length])
        at, place = at + length, place + RECORD_BYTES
    return b"".join(parts), _starts(messages)


def holds(records: bytes, offset: int, channel_id: int, messages: Messages) -> bool:
    """Whether the records that begin at `offset` are those of the messages."""
    starts = _starts(messages) + offset
    if int(starts[-1] + messages.lengths[-1]) + RECORD_BYTES > len(records):
        return False
    heads = np.frombuffer(records, np.uint8)[starts[:, None] + np.arange(RECORD_BYTES)].tobytes()
    view, begins = memoryview(records), (starts + RECORD_BYTES).tolist()
    payload = b"".join([view[at : at + size] for at, size in zip(begins, messages.lengths.tolist(), strict=True)])
    return heads == _heads(channel_id, messages) and payload == messages.payload


def _heads(channel_id: int, messages: Messages) -> bytes:
    heads = np.empty(len(messages.numbers), _HEAD)
    heads["opcode"] = _OPCODE
    heads["length"] = messages.lengths + _FIXED
    heads["channel"] = channel_id
    heads["sequence"] = messages.numbers & 0xFFFFFFFF
    heads["log_ns"] = heads["publish_ns"] = messages.stamps_ns
    return heads.tobytes()


def _starts(messages: Messages) -> Integers:
    sizes = messages.lengths + RECORD_BYTES
    starts: Integers = np.cumsum(sizes) - sizes
    return starts
