"""Linux input events. Pure. Source: the kernel's include/uapi/linux/input.h and input-event-codes.h.

Our own reader: PyPI's `evdev` has no wheels, so it needs a compiler and kernel headers on the robot; the records are
fixed and few. A record is `struct input_event`: seconds and microseconds as C longs, type u16, code u16, value s32.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

__all__ = [
    "DROPPED",
    "EV_ABS",
    "EV_KEY",
    "EV_SYN",
    "RECORD",
    "REPORT",
    "EventReader",
    "InputEvent",
]

RECORD: Final = struct.Struct("@llHHi")
EV_SYN: Final = 0x00
EV_KEY: Final = 0x01
EV_ABS: Final = 0x03
REPORT: Final = 0  # codes of EV_SYN
DROPPED: Final = 3
_MAX_TYPE: Final = 0x1F
_MAX_CODE: Final = 0x2FF


@dataclass(frozen=True, slots=True)
class InputEvent:
    """One change of one axis or button, or the end of a group of them."""

    type: int
    code: int
    value: int


class EventReader:
    """Feed bytes, get events. What cannot be a record is looked through byte by byte, and counted (`skipped_bytes`)."""

    def __init__(self, count: Callable[[str, int], object]) -> None:
        self._count = count
        self._rest = b""

    def feed(self, data: bytes) -> Iterator[InputEvent]:
        """Whole records."""
        data, at, skipped = self._rest + data, 0, 0
        while at + RECORD.size <= len(data):
            seconds, microseconds, kind, code, value = RECORD.unpack_from(data, at)
            if seconds < 0 or not 0 <= microseconds < 1_000_000 or kind > _MAX_TYPE or code > _MAX_CODE:
                at, skipped = at + 1, skipped + 1
                continue
            at += RECORD.size
            yield InputEvent(kind, code, value)
        self._rest = data[at:]
        if skipped:
            self._count("skipped_bytes", skipped)
