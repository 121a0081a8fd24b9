"""The wire format of samples for viewers, live or stored: a channel as JSON, then binary records of its samples.

A record is a 40-byte header, then a sample's bytes, padded to a multiple of 8.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from gateway.domain.channel import Channel
from metaros.errors import FrameError

__all__ = ["HEADER", "Record", "introduction", "record_bytes", "record_parts", "records_bytes", "split_records"]

# record_bytes, subscription, channel, payload_bytes, seq, stamp_ns, gateway_receive_ns
HEADER = struct.Struct("<IIIIQqq")
HEADER_BYTES = HEADER.size
_PADDING = tuple(bytes(count) for count in range(8))


@dataclass(slots=True)
class Record:
    """One sample on its way to viewers; `payload` is shared by all of them, and so is what was decoded of it.

    Nothing of one is changed but its views. It is not frozen, since one is made for every sample, and a frozen one
    takes three times as long to make.
    """

    seq: int
    stamp_ns: int
    receive_ns: int
    payload: bytes
    views: dict[Any, Any] = field(default_factory=dict, compare=False, repr=False)  # see gateway/live/encoding.py

    @property
    def size_bytes(self) -> int:
        """What the record takes in a frame and counts in a queue."""
        return HEADER_BYTES + (len(self.payload) + 7 & ~7)


def introduction(channel: Channel, number: int) -> dict[str, Any]:
    """What a viewer is told of a channel before its first record, which carries `number`."""
    return {
        "op": "channel",
        "channel": number,
        "robot": channel.robot,
        "topic": channel.topic,
        "type": channel.schema_name,
        "type_hash": channel.type_hash,
        "encoding": channel.encoding,
        "schema_encoding": channel.schema_encoding,
        "schema": channel.schema.decode("utf-8", "replace"),
    }


def record_bytes(payload_bytes: int) -> int:
    """A record's size with header and padding."""
    return HEADER_BYTES + (payload_bytes + 7 & ~7)


def records_bytes(records: Iterable[Record]) -> int:
    """Their size together."""
    return sum([HEADER_BYTES + (len(record.payload) + 7 & ~7) for record in records])


def record_parts(records: Iterable[Record], *, subscription: int, channel: int) -> list[bytes]:
    """Headers, payloads and padding, for the caller to join."""
    parts: list[bytes] = []
    add, pack = parts.append, HEADER.pack
    for record in records:
        size = len(record.payload)
        padding = -size & 7
        whole = HEADER_BYTES + size + padding
        add(pack(whole, subscription, channel, size, record.seq, record.stamp_ns, record.receive_ns))
        add(record.payload)
        if padding:
            add(_PADDING[padding])
    return parts


def split_records(frame: bytes) -> Iterator[tuple[int, int, Record]]:
    """(subscription, channel, record) of each record of a frame; FrameError when it is not made of whole records."""
    at = 0
    while at < len(frame):
        if len(frame) - at < HEADER.size:
            raise FrameError(f"{len(frame) - at} bytes are left, a record's header has {HEADER.size}")
        size, subscription, channel, payload_bytes, seq, stamp_ns, receive_ns = HEADER.unpack_from(frame, at)
        if size != record_bytes(payload_bytes) or at + size > len(frame):
            raise FrameError(f"a record of {size} bytes with {payload_bytes} of payload does not fit the frame")
        start = at + HEADER.size
        yield subscription, channel, Record(seq, stamp_ns, receive_ns, frame[start : start + payload_bytes])
        at += size
