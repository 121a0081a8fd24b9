"""The wire of RPLIDARs: requests, answer descriptors, information and health (Slamtec's interface protocol, LR001).

A request is 0xA5 and a command; with a payload, its length, the payload and the exclusive-or of all before follow.
An answer begins with a descriptor: 0xA5 0x5A, a u32 of which the low 30 bits are the length of what follows and the
high 2 whether it repeats, and a type. Little-endian throughout.
"""

from __future__ import annotations

import functools
import operator
import struct
from dataclasses import dataclass
from typing import Final

__all__ = [
    "EXPRESS_SCAN",
    "GET_HEALTH",
    "GET_INFO",
    "RESET",
    "SCAN",
    "SET_PWM",
    "STOP",
    "Descriptor",
    "Health",
    "Info",
    "request",
    "take_descriptor",
]

STOP: Final = 0x25
RESET: Final = 0x40
SCAN: Final = 0x20
EXPRESS_SCAN: Final = 0x82
GET_INFO: Final = 0x50
GET_HEALTH: Final = 0x52
SET_PWM: Final = 0xF0

_START: Final = b"\xa5\x5a"
_DESCRIPTOR_BYTES: Final = 7
_INFO: Final = struct.Struct("<BBBB16s")
_HEALTH: Final = struct.Struct("<BH")
_MODELS: Final = {1: "A1", 2: "A2", 3: "A3", 4: "C1", 6: "S1", 7: "S2", 8: "S3"}


def request(command: int, payload: bytes = b"") -> bytes:
    """The bytes of a request."""
    if not payload:
        return bytes((0xA5, command))
    body = bytes((0xA5, command, len(payload))) + payload
    return body + bytes((functools.reduce(operator.xor, body),))


@dataclass(frozen=True, slots=True)
class Descriptor:
    """What an answer is: its type, the bytes of one part, and whether parts follow until the device is stopped."""

    type: int
    size_bytes: int
    repeats: bool

    def pack(self) -> bytes:
        """Its bytes."""
        return _START + struct.pack("<IB", self.size_bytes | (0x4000_0000 if self.repeats else 0), self.type)


def take_descriptor(kept: bytearray) -> Descriptor | None:
    """The first descriptor in `kept`, which loses it and all before; None, and at most a part kept, without one."""
    found = kept.find(_START)
    if found < 0:
        found = len(kept) - (kept[-1:] == _START[:1])
    del kept[:found]
    if len(kept) < _DESCRIPTOR_BYTES:
        return None
    size, kind = struct.unpack_from("<IB", kept, 2)
    del kept[:_DESCRIPTOR_BYTES]
    return Descriptor(kind, size & 0x3FFF_FFFF, bool(size >> 30))


@dataclass(frozen=True, slots=True)
class Info:
    """Which device it is."""

    model: int
    firmware: tuple[int, int]
    hardware: int
    serial: str

    DESCRIPTOR = Descriptor(0x04, 20, False)

    @classmethod
    def parse(cls, body: bytes) -> Info:
        """From the 20 bytes of an answer."""
        model, minor, major, hardware, serial = _INFO.unpack(body)
        return cls(model, (major, minor), hardware, serial.hex().upper())

    @property
    def name(self) -> str:
        """As people call it."""
        return f"RPLIDAR {_MODELS.get(self.model >> 4, f'model {self.model}')}"

    @property
    def has_express(self) -> bool:
        """Whether its firmware knows express scans (1.17 and later)."""
        return self.firmware >= (1, 17)

    @property
    def needs_pwm(self) -> bool:
        """Whether its motor is set by a command: A2 and A3."""
        return self.model >> 4 in (2, 3)


@dataclass(frozen=True, slots=True)
class Health:
    """Whether it may measure."""

    status: int
    code: int

    DESCRIPTOR = Descriptor(0x06, 3, False)

    @classmethod
    def parse(cls, body: bytes) -> Health:
        """From the 3 bytes of an answer."""
        return cls(*_HEALTH.unpack(body))

    @property
    def word(self) -> str:
        """good, warning or error."""
        return {0: "good", 1: "warning"}.get(self.status, "error")
