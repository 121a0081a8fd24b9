"""Which frames of a video stream can be decoded: read from the messages' CDR, without decoding it. Pure.

A key frame can be decoded by itself; every other frame only straight after the one before it. So whoever leaves a frame
out leaves out all that follow, up to the next key frame: a `GroupGate` sees to that.

NAL unit types: ITU-T H.264, table 7-1, and H.265, table 7-1. The first picture slice of a message decides.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from enum import Enum
from typing import Final

__all__ = ["KEYS_ONLY_HZ", "VIDEO_TYPES", "Frame", "GroupGate", "frame_of", "is_key"]

VIDEO_TYPES: Final = frozenset({"foxglove_msgs/msg/CompressedVideo", "metaros_msgs/msg/VideoPacket"})
KEYS_ONLY_HZ: Final = 2.0  # a limit up to here means key frames only, above it the whole stream: never single frames

_START: Final = b"\x00\x00\x01"
_SEARCHED_BYTES: Final = 64 * 1024  # what stands before the first slice is short
_SEARCHED_UNITS: Final = 64
_STAMP_BYTES: Final = 8
_HEADER_BYTES: Final = 4


class Frame(Enum):
    """What a frame needs to be decoded."""

    KEY = "key"  # nothing
    DELTA = "delta"  # the frame before it
    ALONE = "alone"  # nobody can tell: a format whose key frames are not known here


class GroupGate:
    """Which frames may be passed on: a key frame always, another one only straight after its predecessor."""

    __slots__ = ("_next",)

    def __init__(self) -> None:
        self._next: int | None = None  # the number of the frame that may follow; None: a key frame has to come

    def follows(self, number: int) -> bool:
        """Whether the frame of that number comes straight after the last one that passed."""
        return number == self._next

    def admit(self, frame: Frame, number: int, *, count: int = 1) -> bool:
        """Whether the frame of that number in its stream passes; numbers have no holes where nothing was lost.

        `count` frames go together: the first decides.
        """
        if frame is Frame.DELTA and number != self._next:
            self._next = None
            return False
        self._next = number + count
        return True

    def lost(self) -> None:
        """A frame was left out: nothing passes up to the next key frame."""
        self._next = None


def is_key(type_name: str, payload: bytes) -> bool:
    """Whether decoding can begin with this message."""
    return frame_of(type_name, payload) is Frame.KEY


def frame_of(type_name: str, payload: bytes) -> Frame:
    """What the frame in a message of one of `VIDEO_TYPES` needs; one that cannot be read can be decoded by nobody."""
    try:
        if type_name == "metaros_msgs/msg/VideoPacket":
            return _packet(payload)
        return _compressed(payload)
    except (struct.error, IndexError):
        return Frame.DELTA


def _packet(payload: bytes) -> Frame:
    """A VideoPacket says it: stamp, frame_id, codec, key_frame."""
    order = _order(payload)
    at = _after_text(payload, _HEADER_BYTES + _STAMP_BYTES, order)
    at = _after_text(payload, at, order)
    return Frame.KEY if payload[at] else Frame.DELTA


def _compressed(payload: bytes) -> Frame:
    """A CompressedVideo: timestamp, frame_id, data, format."""
    order = _order(payload)
    at = _aligned(_after_text(payload, _HEADER_BYTES + _STAMP_BYTES, order))
    start = at + 4
    end = start + _number(payload, at, order)
    at = _aligned(end)
    text = payload[at + 4 : at + 4 + _number(payload, at, order)].rstrip(b"\x00").lower()
    slice_of = _SLICES.get(text)
    return Frame.ALONE if slice_of is None else _first_slice(payload, start, end, slice_of)


def _first_slice(payload: bytes, start: int, end: int, slice_of: Callable[[int], Frame | None]) -> Frame:
    """What the first picture slice of an access unit in Annex B is."""
    end = min(end, start + _SEARCHED_BYTES)
    for _ in range(_SEARCHED_UNITS):
        found = payload.find(_START, start, end)
        if found < 0 or found + 3 >= end:
            break
        frame = slice_of(payload[found + 3])
        if frame is not None:
            return frame
        start = found + 3
    return Frame.DELTA


def _h264(unit: int) -> Frame | None:
    kind = unit & 0x1F
    return (Frame.KEY if kind == 5 else Frame.DELTA) if 1 <= kind <= 5 else None


def _h265(unit: int) -> Frame | None:
    kind = unit >> 1 & 0x3F
    return (Frame.KEY if 16 <= kind <= 21 else Frame.DELTA) if kind < 32 else None


_SLICES: Final = {b"h264": _h264, b"h265": _h265}


def _order(payload: bytes) -> str:
    """The byte order that the encapsulation header names."""
    return "<" if payload[1] & 1 else ">"


def _number(payload: bytes, at: int, order: str) -> int:
    number: int = struct.unpack_from(f"{order}I", payload, at)[0]
    return number


def _after_text(payload: bytes, at: int, order: str) -> int:
    at = _aligned(at)
    return at + 4 + _number(payload, at, order)


def _aligned(at: int) -> int:
    """The next multiple of four behind the encapsulation header, which is one itself."""
    return (at + 3) & ~3
