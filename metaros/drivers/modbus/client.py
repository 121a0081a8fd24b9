"""Asking a device, one request at a time. An answer that is late, of another request, or garbage is never taken for it.

Source: MODBUS Messaging on TCP/IP V1.0b; MODBUS over Serial Line V1.02.
"""

from __future__ import annotations

import select
import socket
import struct
import threading
from typing import Final, Protocol

from metaros.drivers.modbus.link import Link
from metaros.drivers.modbus.protocol import EXCEPTIONS, Request, crc16
from metaros.drivers.serial_port import SerialPort
from metaros.drivers.unit import Unit
from metaros.errors import UnavailableError

__all__ = ["Client", "NoAnswerError", "RefusedError", "open_client"]

CONNECT_S: Final = 2.0
_LOOK_S: Final = 0.1
_LONGEST_PDU: Final = 253


class NoAnswerError(Exception):
    """The device did not answer in time."""


class RefusedError(Exception):
    """The device answers that it will not."""

    def __init__(self, code: int) -> None:
        super().__init__(EXCEPTIONS.get(code, f"exception {code}"))
        self.code = code


class Client(Protocol):
    """A device that can be asked."""

    def ask(self, request: Request) -> bytes:
        """The answer that grants it; an end of the driver does not cut it short.

        RefusedError, NoAnswerError; UnavailableError: the line is gone.
        """

    def close(self) -> None:
        """Let the line go."""


def open_client(unit: Unit, link: Link, *, device: int, timeout_s: float) -> Client:
    """Open the line; UnavailableError where that cannot be now."""
    if link.host:
        return _TcpClient(unit, link, device, timeout_s)
    return _RtuClient(unit, link, device, timeout_s)


class _TcpClient:
    def __init__(self, unit: Unit, link: Link, device: int, timeout_s: float) -> None:
        self._unit, self._device, self._timeout_s = unit, device, timeout_s
        self._name = link.name
        self._number = 0
        self._buffer = bytearray()
        try:
            self._socket = socket.create_connection((link.host, link.port), timeout=CONNECT_S)
        except OSError as error:
            raise UnavailableError(f"{self._name}: {error.strerror or error}") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def ask(self, request: Request) -> bytes:
        self._number = self._number % 0xFFFF + 1
        head = struct.pack(">HHHB", self._number, 0, len(request.pdu) + 1, self._device)
        try:
            self._socket.sendall(head + request.pdu)
        except OSError as error:
            raise UnavailableError(f"{self._name}: {error.strerror or error}") from None
        until_s = self._unit.clock.monotonic_s() + self._timeout_s
        while (left_s := until_s - self._unit.clock.monotonic_s()) > 0:
            while (frame := self._frame()) is not None:
                number, device, pdu = frame
                if number != self._number:
                    self._unit.count("late_answers")
                elif device == self._device and _grants(request, pdu):
                    return pdu
                else:
                    self._unit.count("wrong_answers")
            self._read(min(left_s, _LOOK_S))
        raise NoAnswerError

    def close(self) -> None:
        self._socket.close()

    def _read(self, wait_s: float) -> None:
        try:
            if not select.select([self._socket], [], [], wait_s)[0]:
                return
            data = self._socket.recv(4096)
        except (OSError, ValueError) as error:
            raise UnavailableError(f"{self._name}: {error}") from None
        if not data:
            raise UnavailableError(f"{self._name}: the device closed the connection")
        self._buffer += self._unit.heard(data)

    def _frame(self) -> tuple[int, int, bytes] | None:
        if len(self._buffer) < 7:
            return None
        number, protocol, size, device = struct.unpack_from(">HHHB", self._buffer)
        if protocol or not 3 <= size <= _LONGEST_PDU + 1:
            self._unit.count("garbage_bytes", len(self._buffer))
            raise UnavailableError(f"{self._name}: what answers speaks no Modbus")
        if len(self._buffer) < 6 + size:
            return None
        pdu = bytes(self._buffer[7 : 6 + size])
        del self._buffer[: 6 + size]
        return number, device, pdu


class _RtuClient:
    """Answers have no number here: after one that did not come, the line is left alone for a while, and emptied."""

    def __init__(self, unit: Unit, link: Link, device: int, timeout_s: float) -> None:
        self._unit, self._device, self._timeout_s = unit, device, timeout_s
        self._port = SerialPort(unit, link.device, link.baud, parity=link.parity, stop_bits=link.stop_bits)
        self._pause_s = max(0.00175, 38.5 / link.baud)  # three and a half characters of eleven bits
        self._quiet = threading.Event()  # never set: a pause that an end of the driver does not cut short
        self._late_until_s = 0.0

    def ask(self, request: Request) -> bytes:
        self._settle()
        asked = bytes([self._device]) + request.pdu
        self._port.write(asked + crc16(asked))
        buffer = bytearray()
        until_s = self._unit.clock.monotonic_s() + self._timeout_s
        while self._unit.clock.monotonic_s() < until_s:
            buffer += self._port.read()
            if (answer := self._found(buffer, request)) is not None:
                return answer
            del buffer[: -2 * _LONGEST_PDU]
        if buffer:
            self._unit.count("garbage_bytes", len(buffer))
        self._late_until_s = self._unit.clock.monotonic_s() + self._timeout_s
        raise NoAnswerError

    def close(self) -> None:
        self._port.close()

    def _settle(self) -> None:
        while self._unit.clock.monotonic_s() < self._late_until_s and not self._unit.stop.is_set():
            if late := self._port.read():
                self._unit.count("late_bytes", len(late))
        self._quiet.wait(self._pause_s)
        self._port.discard()

    def _found(self, buffer: bytearray, request: Request) -> bytes | None:
        for start in range(len(buffer)):
            if buffer[start] != self._device:
                continue
            for size in (request.answer_size, 2):
                pdu = bytes(buffer[start + 1 : start + 1 + size])
                checksum = bytes(buffer[start + 1 + size : start + 3 + size])
                if len(checksum) == 2 and crc16(bytes([self._device]) + pdu) == checksum and _grants(request, pdu):
                    if start:
                        self._unit.count("garbage_bytes", start)
                    return pdu
        return None


def _grants(request: Request, pdu: bytes) -> bool:
    """Whether it is the answer to that request; RefusedError where it refuses."""
    if len(pdu) == 2 and pdu[0] == request.refusal_head:
        raise RefusedError(pdu[1])
    return len(pdu) == request.answer_size and pdu.startswith(request.answer_head)
