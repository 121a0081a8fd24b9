"""WITMotion's frames. Pure. Source: the maker's data sheets of WT901 and WT901SDCL, chapter on output data.

11 bytes: 55, kind, four int16 little endian, sum of the ten bytes before. Kinds: 51 acceleration (full scale 16 g) and
temperature (1/100 degree), 52 angular velocity (2000 degrees a second), 53 roll, pitch, yaw (180 degrees; turned about
z, then y, then x), 54 magnetic field (milligauss), 59 quaternion (1.0 is 32768). Others (time, ports, pressure, place)
are left. One sample is a round of these frames, with 51 and 52 at least.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Final

from metaros.drivers.imu.sample import GRAVITY_M_S2, Quaternion, Sample
from metaros.drivers.message_groups import MessageGroups

__all__ = ["FRAME_BYTES", "START", "WitMotionDecoder", "checksum", "from_euler"]

FRAME_BYTES: Final = 11
START: Final = 0x55
_WORDS: Final = struct.Struct("<4h")
_KINDS: Final = {0x51: "acceleration", 0x52: "rate", 0x53: "angles", 0x54: "magnetic", 0x59: "quaternion"}
_FIRST_KIND: Final = 0x51  # of each round
_LAST_KIND: Final = 0x5F
_FULL: Final = 32768.0
_ACCELERATION: Final = 16 * GRAVITY_M_S2 / _FULL
_RATE: Final = math.radians(2000) / _FULL
_ANGLE: Final = math.pi / _FULL
_MILLIGAUSS_T: Final = 1e-7


def checksum(data: bytes) -> int:
    """Low byte of the sum."""
    return sum(data) & 0xFF


class WitMotionDecoder:
    """Feed bytes, get samples. Counts `bad_checksum` and `skipped_bytes`, and looks on one byte after a bad start."""

    def __init__(self, count: Callable[[str, int], object]) -> None:
        self._count = count
        self._data = bytearray()
        self._groups = MessageGroups()
        self._turn = 0

    def feed(self, data: bytes) -> Iterator[Sample]:
        """Samples that these bytes complete."""
        self._data += data
        at = 0
        while (start := self._data.find(START, at)) >= 0 and len(self._data) - start >= FRAME_BYTES:
            self._skipped(start - at)
            frame = bytes(self._data[start : start + FRAME_BYTES])
            at = start + FRAME_BYTES
            if not 0x50 <= frame[1] <= _LAST_KIND or checksum(frame[:-1]) != frame[-1]:
                self._count("bad_checksum", 1)
                at = start + 1
            elif frame[1] in _KINDS:
                self._turn += frame[1] == _FIRST_KIND
                for items in self._groups.feed(_KINDS[frame[1]], _WORDS.unpack_from(frame, 2), moment=self._turn):
                    yield from _samples(items)
        end = start if start >= 0 else len(self._data)
        self._skipped(end - at)
        del self._data[:end]

    def _skipped(self, size_bytes: int) -> None:
        if size_bytes:
            self._count("skipped_bytes", size_bytes)


def _samples(items: Mapping[str, Any]) -> Iterator[Sample]:
    if "acceleration" not in items or "rate" not in items:
        return  # a frame of this round was lost
    ax, ay, az, temperature = items["acceleration"]
    gx, gy, gz, _ = items["rate"]
    magnetic = None
    if "magnetic" in items:
        mx, my, mz, _ = items["magnetic"]
        magnetic = (mx * _MILLIGAUSS_T, my * _MILLIGAUSS_T, mz * _MILLIGAUSS_T)
    yield Sample(
        acceleration_m_s2=(ax * _ACCELERATION, ay * _ACCELERATION, az * _ACCELERATION),
        rate_rad_s=(gx * _RATE, gy * _RATE, gz * _RATE),
        magnetic_t=magnetic,
        orientation=_orientation(items),
        temperature_c=temperature / 100,
    )


def _orientation(items: Mapping[str, Any]) -> Quaternion | None:
    if "quaternion" in items:
        w, x, y, z = items["quaternion"]
        length = math.sqrt(w * w + x * x + y * y + z * z)
        return (w / length, x / length, y / length, z / length) if length > _FULL / 2 else None
    if "angles" in items:
        roll, pitch, yaw, _ = items["angles"]
        return from_euler(roll * _ANGLE, pitch * _ANGLE, yaw * _ANGLE)
    return None


def from_euler(roll: float, pitch: float, yaw: float) -> Quaternion:
    """Radians, turned about z, then y, then x."""
    cr, sr = math.cos(roll / 2), math.sin(roll / 2)
    cp, sp = math.cos(pitch / 2), math.sin(pitch / 2)
    cy, sy = math.cos(yaw / 2), math.sin(yaw / 2)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
