"""What an RPLIDAR sends while it scans: standard nodes of 5 bytes, express capsules of 84 (interface protocol, LR001).

A node: byte 0 is quality << 2 | not S << 1 | S, where S is set on the first of a turn; then u16 angle in 1/64 deg << 1
| 1, and u16 distance in 1/4 mm. S, its complement and the check bit are all there is to find the start of a node by,
so after a bad one TRUST good ones in a row are asked for.

A capsule: 0xA and 0x5 in the high halves of its first two bytes, the exclusive-or of bytes 2 to 83 in the low halves
(low half first); u16 start angle in 1/64 deg, whose bit 15 says that it begins anew; 16 pairs of 5 bytes: two u16 with
distance in mm << 2 | the high 2 bits of an angle offset, and one byte with their low 4 bits, the first offset's in its
low half. Offsets are 6 bits in 1/8 deg. They are read as never negative, as the maker's driver does: far things have
almost 8 deg. Sample k of 32 is at start + (next start - start) * k / 32 - offset: a capsule waits for the next one.
"""

from __future__ import annotations

import functools
import operator
import struct
from collections import Counter
from dataclasses import dataclass
from typing import Final, Protocol

from metaros.drivers.rplidar.protocol import Descriptor

__all__ = ["CAPSULE_BYTES", "EXPRESS", "STANDARD", "CapsuleStream", "NodeStream", "Sample", "SampleStream"]

STANDARD: Final = Descriptor(0x81, 5, True)
EXPRESS: Final = Descriptor(0x82, 84, True)
CAPSULE_BYTES: Final = 84
TRUST: Final = 8
_NODE_BYTES: Final = 5
_FULL_Q6: Final = 360 * 64
_EXPRESS_QUALITY: Final = 47  # capsules have none; the maker's driver says this of a return


@dataclass(frozen=True, slots=True)
class Sample:
    """One ray: degrees clockwise from ahead, mm (0: nothing came back), 0 to 63."""

    angle_deg: float
    distance_mm: float
    quality: int


class SampleStream(Protocol):
    """Bytes in, samples out; garbage is skipped and counted. It keeps little."""

    counters: Counter[str]
    delay_ns: int  # of a sample's bytes behind its measurement

    def feed(self, data: bytes) -> list[Sample]:
        """The samples that are whole now."""


class NodeStream:
    """Of standard scans."""

    delay_ns = 434_000  # five bytes at 115200 bit/s

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        self._kept = bytearray()
        self._trusted = True  # a descriptor has just been read

    def feed(self, data: bytes) -> list[Sample]:
        """The samples that are whole now."""
        kept = self._kept
        kept += data
        samples, at = [], 0
        while len(kept) - at >= _NODE_BYTES:
            if not self._trusted:
                if len(kept) - at < TRUST * _NODE_BYTES:
                    break
                self._trusted = all(_sound(kept, at + index * _NODE_BYTES) for index in range(TRUST))
            elif not _sound(kept, at):
                self.counters["bad_check"] += 1
                self._trusted = False
            if self._trusted:
                samples.append(_node(kept, at))
                at += _NODE_BYTES
            else:
                self.counters["skipped_bytes"] += 1
                at += 1
        del kept[:at]
        return samples


def _sound(data: bytearray, at: int) -> bool:
    start = data[at] & 3
    angle_q6 = data[at + 1] >> 1 | data[at + 2] << 7
    return start in (1, 2) and bool(data[at + 1] & 1) and angle_q6 <= _FULL_Q6


def _node(data: bytearray, at: int) -> Sample:
    quality, angle, distance = struct.unpack_from("<BHH", data, at)
    return Sample((angle >> 1) / 64 % 360.0, distance / 4, quality >> 2)


class CapsuleStream:
    """Of express scans."""

    delay_ns = 7_300_000  # the next capsule has to come first, at 115200 bit/s

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        self._kept = bytearray()
        self._before: bytes | None = None

    def feed(self, data: bytes) -> list[Sample]:
        """The samples of the capsules that have a next one now."""
        kept = self._kept
        kept += data
        samples: list[Sample] = []
        at = 0
        while len(kept) - at >= CAPSULE_BYTES:
            if kept[at] >> 4 == 0xA and kept[at + 1] >> 4 == 0x5:
                capsule = bytes(kept[at : at + CAPSULE_BYTES])
                if _checksum(capsule) == capsule[0] & 15 | (capsule[1] & 15) << 4:
                    samples += self._take(capsule)
                    at += CAPSULE_BYTES
                    continue
                self.counters["bad_checksum"] += 1
            self._before = None  # what is missing here would bend its angles
            self.counters["skipped_bytes"] += 1
            at += 1
        del kept[:at]
        return samples

    def _take(self, capsule: bytes) -> list[Sample]:
        before, self._before = self._before, capsule
        if before is None or capsule[3] & 0x80:
            return []
        start, end = _start_deg(before), _start_deg(capsule)
        step = (end - start) % 360.0 / 32
        samples = []
        for pair in range(16):
            first, second, offsets = struct.unpack_from("<HHB", before, 4 + 5 * pair)
            for half, word in enumerate((first, second)):
                offset = (word & 3) << 4 | (offsets >> 4 * half & 15)
                angle = (start + step * (2 * pair + half) - offset / 8) % 360.0
                samples.append(Sample(angle, float(word >> 2), _EXPRESS_QUALITY if word >> 2 else 0))
        return samples


def _checksum(capsule: bytes) -> int:
    return functools.reduce(operator.xor, capsule[2:])


def _start_deg(capsule: bytes) -> float:
    return ((capsule[2] | capsule[3] << 8) & 0x7FFF) / 64 % 360.0
