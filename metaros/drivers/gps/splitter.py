"""NMEA sentences and UBX frames out of one mixed stream of bytes, with bounds and checksums. Pure.

NMEA 0183: `$` or `!`, text, `*`, two hex digits of the XOR of the text, CR LF. The standard allows 82 characters;
receivers send more, so MAX_NMEA is wider. UBX (u-blox interface description): B5 62, class, id, length u16 little
endian, payload, two bytes of Fletcher's checksum over class to payload. Anything else (RTCM, noise) is skipped.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from typing import Final

__all__ = ["MAX_NMEA", "MAX_UBX", "GpsSplitter", "nmea_frame", "ubx_checksum"]

MAX_NMEA: Final = 256
MAX_UBX: Final = 2048
_SYNC: Final = b"\xb5\x62"
_UBX_OVERHEAD: Final = 8
_STARTS: Final = re.compile(rb"[$!\xb5]")


def ubx_checksum(data: bytes) -> bytes:
    """Fletcher's two bytes over class, id, length and payload."""
    a = b = 0
    for byte in data:
        a += byte
        b += a
    return bytes((a & 0xFF, b & 0xFF))


def nmea_frame(text: str) -> bytes:
    """A sentence, from the text between `$` and `*`."""
    return f"${text}*{_xor(text.encode()):02X}\r\n".encode()


class GpsSplitter:
    """Feed bytes, get whole frames that pass their checksum. Counts `bad_checksum`, `skipped_bytes`."""

    def __init__(self, count: Callable[[str, int], object]) -> None:
        self._count = count
        self._data = bytearray()

    def feed(self, data: bytes) -> Iterator[bytes]:
        """Frames: one that begins with `$` or `!` is NMEA, one with B5 is UBX."""
        self._data += data
        at = 0
        while (start := self._next_start(at)) < len(self._data):
            self._skipped(start - at)
            end = self._nmea_end(start) if self._data[start] != _SYNC[0] else self._ubx_end(start)
            if end is None:
                at = start
                break
            at = abs(end)
            if end > 0:
                yield bytes(self._data[start:end])
            else:
                self._skipped(at - start)
        else:
            self._skipped(len(self._data) - at)
            at = len(self._data)
        del self._data[:at]

    def _next_start(self, at: int) -> int:
        found = _STARTS.search(self._data, at)
        return found.start() if found else len(self._data)

    def _skipped(self, size_bytes: int) -> None:
        if size_bytes:
            self._count("skipped_bytes", size_bytes)

    def _nmea_end(self, start: int) -> int | None:
        """The end of a good sentence; where to look on, negative, of a bad one; None while it is not whole."""
        end = self._data.find(b"\n", start, start + MAX_NMEA)
        if end < 0:
            begun = self._data[start : start + MAX_NMEA]
            return None if len(begun) < MAX_NMEA and begun.isascii() else -(start + 1)
        text, star, digits = bytes(self._data[start + 1 : end]).rstrip(b"\r").rpartition(b"*")
        if not star or len(digits) != 2:
            return -(start + 1)
        if digits.upper() != b"%02X" % _xor(text) or not text.isascii():
            self._count("bad_checksum", 1)
            return -(start + 1)
        return end + 1

    def _ubx_end(self, start: int) -> int | None:
        data = self._data
        if len(data) - start < 6:
            return None if _SYNC.startswith(data[start : start + 2]) else -(start + 1)
        length = int.from_bytes(data[start + 4 : start + 6], "little")
        if data[start + 1] != _SYNC[1] or length > MAX_UBX:
            return -(start + 1)
        end = start + _UBX_OVERHEAD + length
        if len(data) < end:
            return None
        if ubx_checksum(bytes(data[start + 2 : end - 2])) != bytes(data[end - 2 : end]):
            self._count("bad_checksum", 1)
            return -(start + 1)
        return end


def _xor(text: bytes) -> int:
    value = 0
    for byte in text:
        value ^= byte
    return value
