"""One chunk of an MCAP file, read by itself: whoever knows where it lies needs nothing else of the file.

Bounded, because the bytes come from a disk or a network: what a chunk says of its size is checked before memory is
taken, and its checksum before anything is made of it.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from typing import Final

import zstandard

__all__ = ["MalformedChunkError", "read_chunk", "read_messages"]

_HEAD: Final = struct.Struct("<BQQQQII")  # opcode, length, first, last, size, crc, length of the compression's name
_MESSAGE: Final = struct.Struct("<BQHIQQ")
_FIXED: Final = _MESSAGE.size - 9
_CHUNK, _RECORD = 6, 5
_WINDOW_BYTES: Final = 1 << 27  # of zstd: what its decoders take by default


class MalformedChunkError(ValueError):
    """The bytes are no chunk, or not the one that was written."""


def read_chunk(data: bytes, *, most_bytes: int) -> bytes:
    """The records of a chunk, uncompressed; `data` is the chunk record from its opcode to its end.

    Raises:
        MalformedChunkError: it is something else, damaged, or holds more than `most_bytes`.
    """
    try:
        opcode, length, _, _, size, crc, name_bytes = _HEAD.unpack_from(data)
        start = _HEAD.size + name_bytes + 8
        name = data[_HEAD.size : start - 8]
        (stored_bytes,) = struct.unpack_from("<Q", data, start - 8)
    except struct.error:
        raise MalformedChunkError("it is shorter than a chunk's head") from None
    if opcode != _CHUNK or length + 9 != len(data) or start + stored_bytes != len(data):
        raise MalformedChunkError("it does not begin and end as a chunk")
    if size > most_bytes:
        raise MalformedChunkError(f"it holds {size} bytes, over the bound of {most_bytes}")
    raw = _unpacked(data[start:], name, size)
    if len(raw) != size or (crc and zlib.crc32(raw) != crc):
        raise MalformedChunkError("its checksum does not hold")
    return raw


def read_messages(records: bytes, offset: int, count: int) -> Iterator[tuple[int, int, int, bytes]]:
    """(channel id, sequence, log time, payload) of `count` messages that lie together from `offset` on.

    Raises:
        MalformedChunkError: there are others, or fewer.
    """
    for _ in range(count):
        if offset + _MESSAGE.size > len(records):
            raise MalformedChunkError("it holds fewer messages")
        opcode, length, channel, sequence, log_ns, _ = _MESSAGE.unpack_from(records, offset)
        end = offset + 9 + length
        if opcode != _RECORD or length < _FIXED or end > len(records):
            raise MalformedChunkError("there is no message where one should be")
        yield channel, sequence, log_ns, records[offset + _MESSAGE.size : end]
        offset = end


def _unpacked(data: bytes, compression: bytes, size: int) -> bytes:
    if not compression:
        return data
    if compression != b"zstd":
        raise MalformedChunkError(f"its compression {compression!r} is not known here")
    try:
        if zstandard.frame_content_size(data) not in (-1, size):  # it would be believed, whatever the bound
            raise MalformedChunkError("its compressed records have another size than it says")
        return zstandard.ZstdDecompressor(max_window_size=_WINDOW_BYTES).decompress(data, max_output_size=max(size, 1))
    except zstandard.ZstdError as error:
        raise MalformedChunkError(str(error)) from None
