"""Requests to a device and the answers that are valid for them, in pymodbus's messages.

Source: MODBUS Application Protocol Specification V1.1b3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from pymodbus.framer import FramerRTU
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu.bit_message import ReadCoilsRequest, ReadDiscreteInputsRequest, WriteSingleCoilRequest
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

__all__ = [
    "EXCEPTIONS",
    "MESSAGES",
    "RefusedError",
    "Request",
    "find_rtu",
    "read_request",
    "rtu_frame",
    "write_request",
]

MESSAGES: Final = DecodePDU(False)  # of devices
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
_READS: Final = {
    "coil": ReadCoilsRequest,
    "discrete": ReadDiscreteInputsRequest,
    "holding": ReadHoldingRegistersRequest,
    "input": ReadInputRegistersRequest,
}
_BIT_READS: Final = (ReadCoilsRequest.function_code, ReadDiscreteInputsRequest.function_code)
_RTU: Final = FramerRTU(MESSAGES)


class RefusedError(Exception):
    """The device answers that it will not."""

    def __init__(self, code: int) -> None:
        super().__init__(EXCEPTIONS.get(code, f"exception {code}"))
        self.code = code


@dataclass(frozen=True, slots=True)
class Request:
    """A request, and what is known of its answer beforehand."""

    pdu: ModbusPDU
    count: int = 0  # of registers or bits that are read

    def answer(self, data: bytes) -> ModbusPDU | None:
        """The message, if it answers this request; RefusedError where the device says that it will not."""
        answer = MESSAGES.decode(data)
        if answer is None:
            return None
        if answer.isError() and answer.function_code == self.pdu.function_code | 0x80:
            raise RefusedError(answer.exception_code)
        return answer if self._granted_by(answer) else None

    def encode(self) -> bytes:
        """The message, without a frame."""
        return bytes([self.pdu.function_code]) + self.pdu.encode()

    def values(self, answer: ModbusPDU) -> tuple[int, ...]:
        """The registers or bits of an answer that grants it."""
        return tuple(int(one) for one in self._read(answer)[: self.count])

    def _granted_by(self, answer: ModbusPDU) -> bool:
        """As many values as were asked for, or a write said again."""
        asked = self.pdu
        if answer.function_code != asked.function_code:
            return False
        if self.count:
            return len(self._read(answer)) == (self.count + 7 & ~7 if self._bits else self.count)
        several = isinstance(asked, WriteMultipleRegistersRequest)  # it is answered by how many, not by what
        same = answer.count == asked.count if several else _values(answer) == _values(asked)
        return answer.address == asked.address and same

    @property
    def _bits(self) -> bool:
        return self.pdu.function_code in _BIT_READS

    def _read(self, answer: ModbusPDU) -> Sequence[int]:
        return answer.bits if self._bits else answer.registers


def _values(pdu: ModbusPDU) -> tuple[list[bool], list[int]]:
    return list(pdu.bits), list(pdu.registers)


def read_request(table: str, address: int, count: int) -> Request:
    """Read registers or bits."""
    return Request(_READS[table](address=address, count=count), count)


def write_request(table: str, address: int, values: Sequence[int]) -> Request:
    """Write one coil, or one register or more; the answer repeats where and what."""
    if table == "coil":
        return Request(WriteSingleCoilRequest(address=address, bits=[bool(values[0])]))
    if len(values) == 1:
        return Request(WriteSingleRegisterRequest(address=address, registers=list(values)))
    return Request(WriteMultipleRegistersRequest(address=address, registers=list(values)))


def rtu_frame(device: int, request: Request) -> bytes:
    """What goes out on a serial line."""
    return _RTU.encode(request.encode(), device, 0)


def find_rtu(buffer: bytes, device: int, request: Request) -> tuple[int, ModbusPDU] | None:
    """Where in what came the answer begins, and the answer: what looks like a frame and is none does not hide it.

    RefusedError, as `answer`.
    """
    for start in range(len(buffer)):
        if buffer[start] == device:
            _, sender, _, data = _RTU.decode(buffer[start:])
            if sender == device and data and (answer := request.answer(data)) is not None:
                return start, answer
    return None
