"""A VLP-16's position packets: 512 bytes with its clock, the state of the PPS line and the last $GPRMC of its GPS."""

from __future__ import annotations

import functools
import operator
import struct
from dataclasses import dataclass
from typing import Final

__all__ = ["POSITION_BYTES", "Position", "parse_position"]

POSITION_BYTES: Final = 512
_CLOCK_AT: Final = 198
_PPS_AT: Final = 202
_NMEA_AT: Final = 206
_PPS: Final = ("absent", "synchronising", "locked", "error")


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """`us` past the hour, by GPS where `pps` is locked. `gps`: valid, void, or none without a sound sentence."""

    us: int
    pps: str
    gps: str
    utc: str


def parse_position(data: bytes) -> Position | None:
    """None for what is no position packet."""
    if len(data) != POSITION_BYTES:
        return None
    (us,) = struct.unpack_from("<I", data, _CLOCK_AT)
    state = data[_PPS_AT]
    gps, utc = _gprmc(data[_NMEA_AT:])
    return Position(us=us, pps=_PPS[state] if state < len(_PPS) else "unknown", gps=gps, utc=utc)


def _gprmc(text: bytes) -> tuple[str, str]:
    line = text.split(b"\0", 1)[0].strip()
    body, _, checksum = line.removeprefix(b"$").partition(b"*")
    fields = body.split(b",")
    try:
        sound = functools.reduce(operator.xor, body, 0) == int(checksum[:2], 16)
    except ValueError:
        sound = False
    if not sound or not line.startswith(b"$") or not fields[0].endswith(b"RMC") or len(fields) < 10:
        return "none", ""
    clock, date = fields[1][:6].decode("ascii", "replace"), fields[9].decode("ascii", "replace")
    return ("valid" if fields[2] == b"A" else "void"), f"{date} {clock}"
