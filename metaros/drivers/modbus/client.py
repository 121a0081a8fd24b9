"""A Modbus client: one request at a time. An answer that is late, of another request, or garbage is never taken for it.

Frames and messages are pymodbus's. Its clients are not used: on a serial line they take the late answer to one request
for that to the next. Source: MODBUS Messaging on TCP/IP V1.0b; MODBUS over Serial Line V1.02.
"""

from __future__ import annotations

import select
import socket
import threading
from typing import Final, Protocol

from pymodbus.framer import FramerSocket
from pymodbus.pdu import ModbusPDU

from metaros.drivers.context import DriverContext
from metaros.drivers.modbus.link import Link
from metaros.drivers.modbus.protocol import MESSAGES, Request, find_rtu, rtu_frame
from metaros.drivers.serial_port import SerialPort
from metaros.errors import UnavailableError

__all__ = ["Client", "NoAnswerError", "open_client"]

CONNECT_S: Final = 2.0
_LOOK_S: Final = 0.1
_LONGEST_FRAME: Final = 260


class NoAnswerError(Exception):
    """The device did not answer in time."""


class Client(Protocol):
    """A device that can be asked."""

    def ask(self, request: Request) -> ModbusPDU:
        """The answer that grants it; an end of the driver does not cut it short.

        RefusedError, NoAnswerError; UnavailableError: the line is gone.
        """

    def close(self) -> None:
        """Let the line go."""


def open_client(context: DriverContext, link: Link, *, device: int, timeout_s: float) -> Client:
    """Open the line; UnavailableError where that cannot be now."""
    if link.host:
        return _TcpClient(context, link, device, timeout_s)
    return _RtuClient(context, link, device, timeout_s)


class _TcpClient:
    def __init__(self, context: DriverContext, link: Link, device: int, timeout_s: float) -> None:
        self._context, self._device, self._timeout_s = context, device, timeout_s
        self._name = link.name
        self._framer = FramerSocket(MESSAGES)
        self._number = 0
        self._buffer = b""
        try:
            self._socket = socket.create_connection((link.host, link.port), timeout=CONNECT_S)
        except OSError as error:
            raise UnavailableError(f"{self._name}: {error.strerror or error}") from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def ask(self, request: Request) -> ModbusPDU:
        self._number = self._number % 0xFFFF + 1
        try:
            self._socket.sendall(self._framer.encode(request.encode(), self._device, self._number))
        except OSError as error:
            raise UnavailableError(f"{self._name}: {error.strerror or error}") from None
        until_s = self._context.clock.monotonic_s() + self._timeout_s
        while (left_s := until_s - self._context.clock.monotonic_s()) > 0:
            while (frame := self._frame()) is not None:
                number, device, data = frame
                if number != self._number:
                    self._context.count("late_answers")
                elif device == self._device and (answer := request.answer(data)) is not None:
                    return answer
                else:
                    self._context.count("wrong_answers")
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
        self._buffer += self._context.heard(data)

    def _frame(self) -> tuple[int, int, bytes] | None:
        strange = any(self._buffer[2:4])  # the protocol's number is 0
        size, device, number, data = (0, 0, 0, b"") if strange else self._framer.decode(self._buffer)
        if data:
            self._buffer = self._buffer[size:]
            return number, device, data
        if strange or size or len(self._buffer) >= _LONGEST_FRAME:
            self._context.count("garbage_bytes", len(self._buffer))
            raise UnavailableError(f"{self._name}: what answers speaks no Modbus")
        return None


class _RtuClient:
    """Answers have no number here: after one that did not come, the line is left alone for a while, and emptied."""

    def __init__(self, context: DriverContext, link: Link, device: int, timeout_s: float) -> None:
        self._context, self._device, self._timeout_s = context, device, timeout_s
        self._port = SerialPort(context, link.device, link.baud, parity=link.parity, stop_bits=link.stop_bits)
        self._pause_s = max(0.00175, 38.5 / link.baud)  # three and a half characters of eleven bits
        self._quiet = threading.Event()  # never set: a pause that an end of the driver does not cut short
        self._late_until_s = 0.0

    def ask(self, request: Request) -> ModbusPDU:
        self._settle()
        self._port.write(rtu_frame(self._device, request))
        buffer = b""
        until_s = self._context.clock.monotonic_s() + self._timeout_s
        while self._context.clock.monotonic_s() < until_s:
            buffer = (buffer + self._port.read())[-2 * _LONGEST_FRAME :]
            if (found := find_rtu(buffer, self._device, request)) is not None:
                garbage_bytes, answer = found
                if garbage_bytes:
                    self._context.count("garbage_bytes", garbage_bytes)
                return answer
        if buffer:
            self._context.count("garbage_bytes", len(buffer))
        self._late_until_s = self._context.clock.monotonic_s() + self._timeout_s
        raise NoAnswerError

    def close(self) -> None:
        self._port.close()

    def _settle(self) -> None:
        while self._context.clock.monotonic_s() < self._late_until_s and not self._context.stop.is_set():
            if late := self._port.read():
                self._context.count("late_bytes", len(late))
        self._quiet.wait(self._pause_s)
        self._port.discard()
