"""The attachment of every sample, query and reply: sequence number, source time, GID of the sender.

33 bytes, little-endian. ROS 2 releases from before mid-2025 wrote the same fields as a string-keyed map of 77 bytes;
both are read, only the new form is written.
"""

from __future__ import annotations

import struct
from typing import NamedTuple

from metaros.errors import AttachmentError

__all__ = ["GID_BYTES", "Attachment", "pack_attachment", "parse_attachment"]

GID_BYTES = 16

# "17p" is a Pascal string: one length byte (always 16), then the 16 bytes; so the gid is packed in the same call.
NEW = struct.Struct("<qq17p")
_OLD_SIZE = 77
_OLD_NAMES = (b"sequence_number", b"source_timestamp", b"source_gid")


class Attachment(NamedTuple):
    """Who sent a sample, when, and as its how-manieth."""

    seq: int
    source_ns: int
    gid: bytes


def pack_attachment(seq: int, source_ns: int, gid: bytes) -> bytes:
    """The 33 bytes; AttachmentError for what a peer would refuse."""
    if len(gid) != GID_BYTES:
        raise AttachmentError(f"gid of {len(gid)} bytes: {GID_BYTES} are required")
    if not (0 <= seq < 1 << 63 and 0 <= source_ns < 1 << 63):
        raise AttachmentError("sequence number and source time must fit a non-negative int64")
    return NEW.pack(seq, source_ns, gid)


def parse_attachment(data: bytes | bytearray | memoryview) -> Attachment:
    """Read either form; AttachmentError for any other bytes."""
    if len(data) == NEW.size:
        if data[16] != GID_BYTES:
            raise AttachmentError(f"gid length {data[16]} in the attachment: {GID_BYTES} is required")
        seq, source_ns, gid = NEW.unpack(data)
    elif len(data) == _OLD_SIZE and bytes(data[:1]) == b"\x0f":
        seq, source_ns, gid = _parse_old(bytes(data))
    else:
        raise AttachmentError(f"attachment of {len(data)} bytes: {NEW.size} are required")
    if seq < 0 or source_ns < 0:
        raise AttachmentError("negative sequence number or source time in the attachment")
    return Attachment(seq, source_ns, gid)


def _parse_old(data: bytes) -> tuple[int, int, bytes]:
    name_seq, seq = data[1:16], data[16:24]
    name_time, source = data[25:41], data[41:49]
    name_gid, gid = data[50:60], data[61:77]
    if (name_seq, name_time, name_gid) != _OLD_NAMES or (data[24], data[49], data[60]) != (16, 10, 16):
        raise AttachmentError("attachment of the old size without the old field names")
    return int.from_bytes(seq, "little", signed=True), int.from_bytes(source, "little", signed=True), gid
