"""Modbus requests and answers, without what carries them. Source: MODBUS Application Protocol Specification V1.1b3."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

__all__ = ["EXCEPTIONS", "Request", "crc16", "read_request", "write_request"]

EXCEPTIONS: Final = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "server device failure",
    5: "acknowledge",
    6: "server device busy",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway target does not answer",
}
_READS: Final = {"coil": 1, "discrete": 2, "holding": 3, "input": 4}
WRITE_COIL, WRITE_REGISTER, WRITE_REGISTERS = 5, 6, 16


@dataclass(frozen=True, slots=True)
class Request:
    """A request, and all that is known of its answer beforehand."""

    pdu: bytes
    answer_head: bytes  # how an answer that grants it begins
    answer_size: int
    count: int = 0  # of registers or bits that are read

    @property
    def refusal_head(self) -> int:
        """The first byte of an answer that refuses it; the code follows."""
        return self.pdu[0] | 0x80

    def values(self, answer: bytes) -> tuple[int, ...]:
        """The registers or bits of an answer that has the right head and size."""
        if self.pdu[0] in (1, 2):
            return tuple(answer[2 + i // 8] >> i % 8 & 1 for i in range(self.count))
        return struct.unpack_from(f">{self.count}H", answer, 2) if self.count else ()


def read_request(table: str, address: int, count: int) -> Request:
    """Read registers or bits."""
    function = _READS[table]
    size = (count + 7) // 8 if function in (1, 2) else 2 * count
    return Request(struct.pack(">BHH", function, address, count), bytes([function, size]), 2 + size, count)


def write_request(table: str, address: int, values: Sequence[int]) -> Request:
    """Write one coil, or one register or more; the answer repeats where and what."""
    if table == "coil":
        pdu = struct.pack(">BHH", WRITE_COIL, address, 0xFF00 if values[0] else 0)
        return Request(pdu, pdu, len(pdu))
    if len(values) == 1:
        pdu = struct.pack(">BHH", WRITE_REGISTER, address, values[0])
        return Request(pdu, pdu, len(pdu))
    head = struct.pack(">BHH", WRITE_REGISTERS, address, len(values))
    return Request(head + struct.pack(f">B{len(values)}H", 2 * len(values), *values), head, len(head))


def crc16(data: bytes) -> bytes:
    """The checksum at the end of an RTU frame: polynomial 0xA001 (reflected), begins with 0xFFFF, low byte first."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
    return crc.to_bytes(2, "little")


def _table() -> tuple[int, ...]:
    found = []
    for number in range(256):
        for _ in range(8):
            number = number >> 1 ^ (0xA001 if number & 1 else 0)
        found.append(number)
    return tuple(found)


_TABLE: Final = _table()
