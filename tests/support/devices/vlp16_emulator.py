"""A VLP-16's packets of a room with a floor, byte for byte, made by numpy so that they come at full rate."""

from __future__ import annotations

import functools
import operator
import struct
from collections.abc import Iterator

import numpy as np

from metaros.drivers.vlp16.packets import BLOCK_US, BLOCKS, DUAL, ELEVATIONS_DEG, PACKET_DTYPE
from tests.support.devices.room import AHEAD_M, BEHIND_M, LEFT_M, RIGHT_M

__all__ = ["FLOOR_M", "Vlp16Emulator", "position_packet"]

FLOOR_M = -0.4  # below the sensor
HOUR_US = 3_600_000_000
_LASERS = np.tile(np.arange(16), 2)
_PART = np.repeat([0.0, 0.5], 16) + _LASERS * 2.304 / BLOCK_US


class Vlp16Emulator:
    """One packet after the other. `us` is its clock past the hour, `azimuth_deg` where it looks."""

    def __init__(self, *, speed_hz: float = 10.0, mode: int = 0x37, azimuth_deg: float = 0.0, us: float = 0.0) -> None:
        self.step_deg = 360 * speed_hz * BLOCK_US / 1e6
        self.mode = mode
        self.azimuth_deg = azimuth_deg
        self.us = us

    def packet(self) -> bytes:
        """The next one."""
        dual = self.mode == DUAL
        made = np.zeros((), PACKET_DTYPE)
        azimuths = self.azimuth_deg + np.arange(BLOCKS) // (2 if dual else 1) * self.step_deg
        returns = made["blocks"]["returns"]
        made["blocks"]["flag"] = 0xEEFF
        made["blocks"]["azimuth"] = np.rint(azimuths * 100).astype(int) % 36000
        returns["distance"] = np.rint(distances_m(azimuths[:, None] + _PART * self.step_deg) / 0.002)
        returns["reflectivity"] = 10 + _LASERS
        if dual:  # of the second block of a pair every other ray saw something nearer
            returns["distance"][1::2, ::2] //= 2
        made["us"], made["mode"], made["product"] = int(self.us) % HOUR_US, self.mode, 0x22
        blocks = BLOCKS // 2 if dual else BLOCKS
        self.azimuth_deg = (self.azimuth_deg + blocks * self.step_deg) % 360
        self.us += blocks * BLOCK_US
        return made.tobytes()

    def turns(self, count: float) -> Iterator[bytes]:
        """The packets of so many turns."""
        blocks = BLOCKS // 2 if self.mode == DUAL else BLOCKS
        for _ in range(round(count * 360 / self.step_deg / blocks)):
            yield self.packet()


def distances_m(azimuths_deg: np.ndarray) -> np.ndarray:
    """To walls or floor, of (blocks, 32) azimuths."""
    azimuth, elevation = np.radians(azimuths_deg), np.radians(np.array(ELEVATIONS_DEG))[_LASERS]
    x, y, z = np.cos(azimuth) * np.cos(elevation), -np.sin(azimuth) * np.cos(elevation), np.sin(elevation)
    with np.errstate(divide="ignore"):
        walls = np.minimum(np.where(x > 0, AHEAD_M, BEHIND_M) / np.abs(x), np.where(y > 0, LEFT_M, RIGHT_M) / np.abs(y))
        floor = np.where(z < 0, FLOOR_M / np.where(z < 0, z, -1), np.inf)
    found: np.ndarray = np.minimum(walls, floor)
    return found


def position_packet(
    us: int, pps: int, sentence: str = "GPRMC,120304,A,5209.1,N,00923.2,E,0.0,0.0,231126,0.0,E"
) -> bytes:
    """512 bytes; the sentence without $ and checksum."""
    body = sentence.encode()
    text = b"$" + body + f"*{functools.reduce(operator.xor, body):02X}\r\n".encode()
    head = bytes(198) + struct.pack("<IB3x", us, pps)
    return (head + text).ljust(512, b"\0")
