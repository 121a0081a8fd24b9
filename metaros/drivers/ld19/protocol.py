"""The wire of LD06 and LD19: packets of 47 bytes, one way, 230400 bit/s (maker's development manual).

0x54, 0x2C (its low 5 bits: 12 points), speed u16 in deg/s, first angle u16 in 0.01 deg, 12 × (distance u16 in mm,
intensity u8), last angle u16, time u16 in ms that begins anew at 30000, CRC-8 (polynomial 0x4D, from 0) of all before.
"""

from __future__ import annotations

import struct
from collections import Counter
from dataclasses import dataclass
from typing import Final

__all__ = ["BAUD", "CLOCK_MS", "PACKET_BYTES", "POINTS", "Packet", "PacketStream", "crc8", "pack"]

BAUD: Final = 230_400
PACKET_BYTES: Final = 47
POINTS: Final = 12
CLOCK_MS: Final = 30_000
_HEAD: Final = b"\x54\x2c"
_LAYOUT: Final = struct.Struct("<2sHH" + "HB" * POINTS + "HH")


def _table() -> bytes:
    table = bytearray()
    for value in range(256):
        for _ in range(8):
            value = (value << 1) ^ (0x4D if value & 0x80 else 0)
        table.append(value & 0xFF)
    return bytes(table)


_CRC: Final = _table()


def crc8(data: bytes | bytearray | memoryview) -> int:
    """The checksum of a packet's first 46 bytes."""
    crc = 0
    for byte in data:
        crc = _CRC[crc ^ byte]
    return crc


@dataclass(frozen=True, slots=True, kw_only=True)
class Packet:
    """Twelve points. Angles in degrees, clockwise from ahead; the points lie evenly between first and last."""

    speed_deg_s: int
    first_deg: float
    last_deg: float
    distances_mm: tuple[int, ...]
    intensities: tuple[int, ...]
    clock_ms: int

    @property
    def angles_deg(self) -> list[float]:
        """Of each point, 0 to 360."""
        step = ((self.last_deg - self.first_deg) % 360.0) / (POINTS - 1)
        return [(self.first_deg + index * step) % 360.0 for index in range(POINTS)]


def pack(packet: Packet) -> bytes:
    """The bytes of a packet."""
    pairs = [number for pair in zip(packet.distances_mm, packet.intensities, strict=True) for number in pair]
    first, last = round(packet.first_deg * 100) % 36000, round(packet.last_deg * 100) % 36000
    body = _LAYOUT.pack(_HEAD, packet.speed_deg_s, first, *pairs, last, packet.clock_ms % CLOCK_MS)
    return body + bytes((crc8(body),))


class PacketStream:
    """Bytes in, packets out; what fits nowhere is skipped byte by byte and counted. It keeps less than one packet."""

    def __init__(self) -> None:
        self.counters: Counter[str] = Counter()
        self._kept = bytearray()

    def feed(self, data: bytes) -> list[Packet]:
        """The packets that are whole now."""
        kept = self._kept
        kept += data
        packets, at = [], 0
        while True:
            found = kept.find(_HEAD, at)
            if found < 0:
                found = len(kept) - (kept[-1:] == _HEAD[:1])
            self._skip(found - at)
            at = found
            if len(kept) - at < PACKET_BYTES:
                break
            end = at + PACKET_BYTES
            if crc8(kept[at : end - 1]) == kept[end - 1]:
                packets.append(_packet(bytes(kept[at : end - 1])))
                at = end
            else:
                self.counters["bad_crc"] += 1
                self._skip(1)
                at += 1
        del kept[:at]
        return packets

    def _skip(self, by: int) -> None:
        if by:
            self.counters["skipped_bytes"] += by


def _packet(body: bytes) -> Packet:
    _, speed, first, *pairs, last, clock_ms = _LAYOUT.unpack(body)
    return Packet(
        speed_deg_s=speed,
        first_deg=first % 36000 / 100,
        last_deg=last % 36000 / 100,
        distances_mm=tuple(pairs[::2]),
        intensities=tuple(pairs[1::2]),
        clock_ms=clock_ms % CLOCK_MS,
    )
