"""Frames on a serial line: COBS between zero bytes, with a checksum. Pure.

A frame is `kind, channel, payload, CRC` (two bytes, low one first) in COBS (Cheshire and Baker, "Consistent Overhead
Byte Stuffing", 1999; PyPI's `cobs` does it), then one zero byte. The CRC is CRC-16/IBM-3740 (polynomial 0x1021, begins
with 0xFFFF) over all before it. A reader that comes late, or lost bytes, is right again after the next zero.
"""

from __future__ import annotations

import binascii
from collections.abc import Callable, Iterator
from typing import Final, NamedTuple

from cobs import cobs

__all__ = ["OVERHEAD_BYTES", "Frame", "FrameSplitter", "encode_frame"]

_HEAD: Final = 2
_CRC: Final = 2
OVERHEAD_BYTES: Final = _HEAD + _CRC


class Frame(NamedTuple):
    """One frame that came whole."""

    kind: int
    channel: int
    payload: bytes


def encode_frame(kind: int, channel: int, payload: bytes = b"") -> bytes:
    """The bytes on the line, with the zero that ends them."""
    body = bytes((kind, channel)) + payload
    return bytes(cobs.encode(body + binascii.crc_hqx(body, 0xFFFF).to_bytes(2, "little"))) + b"\0"


class FrameSplitter:
    """Bytes in, frames out. What is no frame is skipped and counted as `bad_frame`, `bad_crc` or `too_long`."""

    def __init__(self, *, max_bytes: int, count: Callable[[str], object]) -> None:
        self._max_bytes = max_bytes + OVERHEAD_BYTES + max_bytes // 254 + 1
        self._count = count
        self._buffer = bytearray()
        self._skipping = False

    def feed(self, data: bytes) -> Iterator[Frame]:
        """The frames that are whole now."""
        *whole, rest = data.split(b"\0")
        for part in whole:
            self._add(part)
            frame = None if self._skipping else self._decoded()
            self._buffer.clear()
            self._skipping = False
            if frame is not None:
                yield frame
        self._add(rest)

    def _add(self, part: bytes) -> None:
        if self._skipping:
            return
        if len(self._buffer) + len(part) > self._max_bytes:
            self._skipping = True
            self._buffer.clear()
            self._count("too_long")
            return
        self._buffer += part

    def _decoded(self) -> Frame | None:
        if not self._buffer:
            return None  # zeros between frames are welcome
        try:
            body = cobs.decode(bytes(self._buffer))
        except cobs.DecodeError:
            self._count("bad_frame")
            return None
        if len(body) < OVERHEAD_BYTES:
            self._count("bad_frame")
            return None
        if binascii.crc_hqx(body[:-_CRC], 0xFFFF) != int.from_bytes(body[-_CRC:], "little"):
            self._count("bad_crc")
            return None
        return Frame(body[0], body[1], bytes(body[_HEAD:-_CRC]))
