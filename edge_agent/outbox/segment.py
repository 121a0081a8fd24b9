"""The outbox's file format: a segment is a header and then frames, each with its own CRC. Pure: bytes in, bytes out.

A segment starts with `MAGIC`, the CRC-32 and the length of a JSON header, and the header. A frame is 44 bytes of
numbers and a body; its CRC-32 covers everything after itself, and three bytes among the numbers check those alone, so
that a damaged length is never taken for a frame that was cut off. The body of samples is what the link carries of a
Batch after its numbers (columns `stamps`, `lengths`, `payload`, or a MetricBatch's three), so that sending is a copy;
the body of a gap is JSON. Little-endian throughout.
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Literal, NamedTuple

from edge_agent.errors import CorruptError
from metaros.limits import LIMITS
from metaros.link.columns import MAX_SEQ

__all__ = ["Frame", "Gap", "Kind", "Scan", "SegmentHeader", "pack_frame", "pack_header", "read_header", "scan"]

MAGIC = b"MROUTBX1"
_PREFIX = struct.Struct("<8sII")  # magic, CRC of the JSON, its length
_FRAME = struct.Struct("<IIIIQIqq")  # CRC, body length, check << 8 | kind, stream, first, count, wall ns, monotonic ns
_CRC_BYTES = 4
_HEADER_BYTES = 4 * 1024 * 1024  # a header names every stream of its log
_BODY_BYTES = LIMITS.sample_bytes + 64 * 1024
FRAME_BYTES = _FRAME.size
_KINDS = (1, 2, 3)
_NO_FACTS = (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)


class Kind(IntEnum):
    """What a frame's body is."""

    SAMPLES = 1  # columns of a Batch
    METRICS = 2  # columns of a MetricBatch
    GAP = 3  # numbers that were accepted and are lost


class Gap(NamedTuple):
    """Sequence numbers that were accepted and are lost, with the wall time of their loss."""

    from_seq: int
    to_seq: int
    reason: str
    from_ns: int
    to_ns: int


@dataclass(frozen=True, slots=True)
class Frame:
    """A run of one stream's numbers: samples, metric rows, or a gap."""

    kind: Kind
    stream_id: int
    first_seq: int
    count: int
    wall_ns: int  # when it was accepted
    mono_ns: int
    body: bytes

    @property
    def last_seq(self) -> int:
        """The newest number it stands for."""
        return self.first_seq + self.count - 1 if self.kind is not Kind.GAP else self.gap().to_seq

    def gap(self) -> Gap:
        """The body of a gap frame."""
        facts = json.loads(self.body)
        return Gap(self.first_seq, facts["to"], facts["reason"], facts["from_ns"], facts["to_ns"])

    @classmethod
    def of_gap(cls, stream_id: int, gap: Gap, *, wall_ns: int, mono_ns: int) -> Frame:
        """A gap as a frame."""
        facts = {"to": gap.to_seq, "reason": gap.reason, "from_ns": gap.from_ns, "to_ns": gap.to_ns}
        body = json.dumps(facts, separators=(",", ":")).encode()
        return cls(Kind.GAP, stream_id, gap.from_seq, 0, wall_ns, mono_ns, body)


@dataclass(frozen=True, slots=True, kw_only=True)
class SegmentHeader:
    """Where a segment stands in its log: `last` holds each stream's newest number before it.

    A rewritten one no longer has all its frames: `until` holds each stream's newest number at its end.
    """

    era: int  # names the epoch in the outbox's state
    boot_id: str = ""  # monotonic times are only comparable within one boot
    last: Mapping[int, int] = field(default_factory=dict)
    until: Mapping[int, int] = field(default_factory=dict)
    rewritten: Literal["", "thinned", "dropped"] = ""


class Scan(NamedTuple):
    """The sound frames of some bytes, where they end, and why they end there."""

    frames: list[Frame]
    ends: list[int]  # the offset after each frame
    state: Literal["clean", "torn", "corrupt"]  # torn: the last frame is not all there

    def end(self, start: int) -> int:
        """The offset after the last sound frame."""
        return self.ends[-1] if self.ends else start


def pack_header(header: SegmentHeader) -> bytes:
    """A segment's first bytes."""
    facts = {
        "era": header.era,
        "boot": header.boot_id,
        "last": {str(stream): seq for stream, seq in header.last.items()},
        "until": {str(stream): seq for stream, seq in header.until.items()},
        "rewritten": header.rewritten,
    }
    body = json.dumps(facts, separators=(",", ":")).encode()
    return _PREFIX.pack(MAGIC, zlib.crc32(body), len(body)) + body


def read_header(data: bytes) -> tuple[SegmentHeader, int]:
    """A segment's header and the offset of its first frame.

    Raises:
        CorruptError: these are not the first bytes of a segment.
    """
    if len(data) < _PREFIX.size:
        raise CorruptError("a segment without a header")
    magic, crc, size = _PREFIX.unpack_from(data)
    body = data[_PREFIX.size : _PREFIX.size + size]
    if magic != MAGIC or size > _HEADER_BYTES or len(body) != size or zlib.crc32(body) != crc:
        raise CorruptError("a segment with a damaged header")
    try:
        facts = json.loads(body)
        header = SegmentHeader(
            era=int(facts["era"]),
            boot_id=str(facts["boot"]),
            last={int(stream): int(seq) for stream, seq in facts["last"].items()},
            until={int(stream): int(seq) for stream, seq in facts["until"].items()},
            rewritten=facts["rewritten"],
        )
    except _NO_FACTS as error:
        raise CorruptError("a segment whose header says something else than this program writes") from error
    return header, _PREFIX.size + size


def header_is_cut(data: bytes) -> bool:
    """Whether these bytes, all of a file, end inside a header: nothing of that file was ever accepted."""
    if not MAGIC.startswith(data[: len(MAGIC)]):
        return False
    if len(data) < _PREFIX.size:
        return True
    size = _PREFIX.unpack_from(data)[2]
    return len(data) < _PREFIX.size + size and b'"}' not in data[_PREFIX.size :]  # else the length is damaged


def header_size(data: bytes) -> int:
    """How many bytes prefix and header take, from the first 16 of them; 0 when they are no header's."""
    if len(data) < _PREFIX.size:
        return 0
    magic, _, size = _PREFIX.unpack_from(data)
    return int(_PREFIX.size + size) if magic == MAGIC and size <= _HEADER_BYTES else 0


def pack_frame(frame: Frame) -> bytes:
    """A frame's bytes."""
    numbers = (frame.stream_id, frame.first_seq, frame.count, frame.wall_ns, frame.mono_ns)
    head = _FRAME.pack(0, len(frame.body), frame.kind, *numbers)
    head = _FRAME.pack(0, len(frame.body), _check(head, 0) << 8 | frame.kind, *numbers)[_CRC_BYTES:]
    crc = zlib.crc32(frame.body, zlib.crc32(head))
    return b"".join((crc.to_bytes(_CRC_BYTES, "little"), head, frame.body))


def _check(data: bytes | memoryview, offset: int) -> int:
    """Three bytes over a frame's numbers without their place."""
    length, numbers = data[offset + _CRC_BYTES : offset + 9], data[offset + 12 : offset + FRAME_BYTES]
    return zlib.crc32(numbers, zlib.crc32(length)) >> 8


def scan(data: bytes | memoryview, start: int = 0, *, max_frames: int = 1 << 30) -> Scan:
    """Read frames from `start` until the bytes end, a frame is cut off, or one is damaged."""
    view = memoryview(data)
    frames: list[Frame] = []
    ends: list[int] = []
    offset = start
    while offset < len(view) and len(frames) < max_frames:
        if len(view) - offset < FRAME_BYTES:
            return Scan(frames, ends, "torn")
        crc, size, mark, stream, first, count, wall_ns, mono_ns = _FRAME.unpack_from(view, offset)
        kind = mark & 0xFF
        if size > _BODY_BYTES or kind not in _KINDS or mark >> 8 != _check(view, offset):
            return Scan(frames, ends, "corrupt")
        end = offset + FRAME_BYTES + size
        if end > len(view):
            return Scan(frames, ends, "torn")
        if zlib.crc32(view[offset + _CRC_BYTES : end]) != crc:
            return Scan(frames, ends, "corrupt")
        frame = Frame(Kind(kind), stream, first, count, wall_ns, mono_ns, bytes(view[offset + FRAME_BYTES : end]))
        if first + count > MAX_SEQ or (frame.kind is Kind.GAP and not _is_gap(frame)):
            return Scan(frames, ends, "corrupt")
        frames.append(frame)
        ends.append(end)
        offset = end
    return Scan(frames, ends, "clean")


def _is_gap(frame: Frame) -> bool:
    """Whether the body is a gap's: a checksum says that it was written so, not by whom."""
    try:
        gap = frame.gap()
        numbers = (gap.from_seq, gap.to_seq, gap.from_ns, gap.to_ns)
        return all(type(number) is int and abs(number) < MAX_SEQ for number in numbers) and type(gap.reason) is str
    except _NO_FACTS:
        return False


def frame_size(data: bytes | memoryview, offset: int) -> int:
    """How many bytes the frame at `offset` takes, by its own word; FRAME_BYTES when even its numbers are cut off."""
    if len(data) - offset < FRAME_BYTES:
        return FRAME_BYTES
    return FRAME_BYTES + int.from_bytes(data[offset + 4 : offset + 8], "little")
