"""An RPLIDAR in a room, byte for byte: answers requests, scans by nodes or capsules; can be ill, slow, or wrong."""

from __future__ import annotations

import functools
import operator
import struct
from collections.abc import Callable

from metaros.drivers.rplidar.protocol import Descriptor, Health, Info
from metaros.drivers.rplidar.samples import EXPRESS, STANDARD
from tests.support.devices.room import distance_m

__all__ = ["RplidarEmulator", "capsule", "node"]

SAMPLES = 32
OFFSET_Q3 = 61  # almost 8 degrees, as far things have


def node(angle_deg: float, distance_mm: float, quality: int, *, start: bool) -> bytes:
    """Five bytes of a standard scan."""
    first = quality << 2 | (0b01 if start else 0b10)
    return struct.pack("<BHH", first, round(angle_deg * 64) % (360 * 64) << 1 | 1, round(distance_mm * 4))


def capsule(start_deg: float, samples: list[tuple[int, int]], *, start: bool = False) -> bytes:
    """84 bytes of an express scan: 32 times distance in mm and angle offset in 1/8 degree."""
    body = struct.pack("<H", round(start_deg * 64) % (360 * 64) | (0x8000 if start else 0))
    for first, second in zip(samples[::2], samples[1::2], strict=True):
        words = [distance << 2 | offset >> 4 for distance, offset in (first, second)]
        body += struct.pack("<HHB", *words, first[1] & 15 | (second[1] & 15) << 4)
    checksum = functools.reduce(operator.xor, body)
    return bytes((0xA0 | checksum & 15, 0x50 | checksum >> 4)) + body


class RplidarEmulator:
    """Feed it what the host writes by `heard`; it writes its answers, and by `scan` so many samples."""

    def __init__(self, write: Callable[[bytes], object], *, express: bool = True, model: int = 0x18) -> None:
        self._write = write
        self._asked = b""
        self._angle = 0.0
        self._fresh = True
        self.express = express
        self.model = model
        self.firmware = (1, 29)
        self.status = 0
        self.heals = True
        self.mute = 0  # so many requests are not answered
        self.on_mute: Callable[[], object] = lambda: None  # called for each of them
        self.wrong_answers = False
        self.scanning: Descriptor | None = None
        self.commands: list[int] = []
        self.pwm: list[int] = []

    def heard(self, data: bytes) -> None:
        """Obey whole requests; keep the rest."""
        self._asked += data
        while (at := self._asked.find(b"\xa5")) >= 0 and len(self._asked) > at + 1:
            command = self._asked[at + 1]
            size = 2
            if command & 0x80:
                if len(self._asked) < at + 3 or len(self._asked) < at + 4 + self._asked[at + 2]:
                    return
                size = 4 + self._asked[at + 2]
            request, self._asked = self._asked[at : at + size], self._asked[at + size :]
            self._obey(command, request)

    def _obey(self, command: int, request: bytes) -> None:
        self.commands.append(command)
        if command in (0x25, 0x40):
            self.scanning = None
        if command == 0x40:
            self.status = 0 if self.heals else self.status
            self._write(b"RP LIDAR System.\r\nFirmware Ver 1.29 - rtm\r\n")
        if command == 0xF0 and functools.reduce(operator.xor, request) == 0:
            self.pwm.append(struct.unpack_from("<H", request, 3)[0])
        if command in (0x25, 0x40, 0xF0):
            return
        if self.mute:
            self.mute -= 1
            self.on_mute()
            return
        if self.wrong_answers:
            self._write(Descriptor(0x15, 4, False).pack() + bytes(4))
        minor, major = self.firmware[1], self.firmware[0]
        if command == 0x50:
            self._write(Info.DESCRIPTOR.pack() + bytes((self.model, minor, major, 7)) + bytes(range(16)))
        elif command == 0x52:
            self._write(Health.DESCRIPTOR.pack() + struct.pack("<BH", self.status, 0x8001 if self.status else 0))
        elif command == 0x20:
            self._begin(STANDARD)
        elif command == 0x82 and self.express:
            assert request == bytes.fromhex("A5 82 05 00 00 00 00 00 22")
            self._begin(EXPRESS)

    def _begin(self, kind: Descriptor) -> None:
        self.scanning, self._fresh = kind, True
        self._write(kind.pack())

    def samples(self, count: int, *, step_deg: float = 0.9) -> bytes:
        """The next so many samples (32 at a time in express scans), as it would send them."""
        if self.scanning == EXPRESS:
            return b"".join(self._capsule(step_deg) for _ in range(count // SAMPLES))
        return b"".join(self._node(step_deg) for _ in range(count))

    def _node(self, step_deg: float) -> bytes:
        angle, self._angle = self._angle, (self._angle + step_deg) % 360
        return node(angle, 1000 * distance_m(angle), 15, start=angle < step_deg)

    def _capsule(self, step_deg: float) -> bytes:
        raw = [self._angle + index * step_deg for index in range(SAMPLES)]
        made = [(round(1000 * distance_m(angle - OFFSET_Q3 / 8)), OFFSET_Q3) for angle in raw]
        sent = capsule(self._angle, made, start=self._fresh)
        self._angle, self._fresh = (self._angle + SAMPLES * step_deg) % 360, False
        return sent
