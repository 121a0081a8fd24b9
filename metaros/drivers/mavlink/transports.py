"""Transports of MAVLink's bytes: UDP, TCP or a serial port, all with the same three methods."""

from __future__ import annotations

import select
import socket
from typing import Final, Protocol

from metaros.drivers.context import DriverContext
from metaros.drivers.serial_port import SerialPort
from metaros.errors import ConfigError, UnavailableError

__all__ = ["Transport", "check_link", "open_transport"]

READ_S: Final = 0.02
CONNECT_S: Final = 2.0
_MOST_BYTES: Final = 65535
_EXAMPLE: Final = "such as udp:127.0.0.1:14550, udpout:10.0.0.2:14550, tcp:10.0.0.2:5760 or /dev/ttyACM0"


class Transport(Protocol):
    """What a link is read and written by."""

    def read(self) -> bytes:
        """What came, READ_S waited for at most; UnavailableError when the other end has gone."""

    def write(self, data: bytes) -> None:
        """Send; from any thread."""

    def adopt(self) -> None:
        """What was read last came from the vehicle: answer there."""

    def close(self) -> None:
        """Let it go."""


def check_link(text: str) -> tuple[str, str, int]:
    """Kind (udp, udpout, tcp, serial), host or port name, and number. ConfigError where it is none."""
    kind, colon, rest = text.partition(":")
    if kind not in ("udp", "udpout", "tcp"):
        if not text:
            raise ConfigError(f"mavlink: link is empty; {_EXAMPLE}")
        return "serial", rest if colon and kind == "serial" else text, 0
    host, _, number = rest.rpartition(":")
    if not (host and number.isascii() and number.isdigit() and 0 < int(number) < 65536):
        raise ConfigError(f"mavlink: link {text!r} is no {kind}:HOST:PORT; {_EXAMPLE}")
    return kind, host.strip("[]"), int(number)


def open_transport(context: DriverContext, link: str, baud: int) -> Transport:
    """Open a link. UnavailableError: it cannot be had now; ConfigError: never."""
    kind, host, port = check_link(link)
    if kind == "serial":
        return _SerialTransport(context, host, baud)
    return (
        _TcpTransport(context, host, port)
        if kind == "tcp"
        else _UdpTransport(context, host, port, listens=kind == "udp")
    )


class _SerialTransport:
    def __init__(self, context: DriverContext, port: str, baud: int) -> None:
        self._port = SerialPort(context, port, baud)
        self._port.discard()
        self.read = self._port.read
        self.write = self._port.write
        self.close = self._port.close

    def adopt(self) -> None:
        pass


class _UdpTransport:
    """Listening, it sends nothing until a sender was adopted, and then hears that one alone until it is closed."""

    def __init__(self, context: DriverContext, host: str, port: int, *, listens: bool) -> None:
        self._context = context
        self._name = f"UDP {host}:{port}"
        family, address = _resolved(host, port, socket.SOCK_DGRAM, self._name)
        self._socket = socket.socket(family, socket.SOCK_DGRAM)
        self._peer = None if listens else address
        self._latest = self._peer
        try:
            self._socket.setblocking(False)
            if listens:
                self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise UnavailableError(f"{self._name}: {error.strerror or error}") from None

    def read(self) -> bytes:
        try:
            if not select.select([self._socket], [], [], READ_S)[0]:
                return b""
            data, sender = self._socket.recvfrom(_MOST_BYTES)
        except (BlockingIOError, ConnectionError):  # refused: nobody listens there now; silence tells the rest
            return b""
        except (OSError, ValueError) as error:
            raise UnavailableError(f"{self._name}: {error}") from None
        if self._peer is not None and sender[:2] != self._peer[:2]:
            self._context.count("foreign_packets")
            return b""
        self._latest = sender
        return self._context.heard(data)

    def write(self, data: bytes) -> None:
        if self._peer is None:
            return
        try:
            self._socket.sendto(data, self._peer)
        except (BlockingIOError, ConnectionError):
            self._context.count("unsent")
        except OSError as error:
            raise UnavailableError(f"{self._name}: {error.strerror or error}") from None

    def adopt(self) -> None:
        if self._peer is None:
            self._peer = self._latest

    def close(self) -> None:
        self._socket.close()


class _TcpTransport:
    def __init__(self, context: DriverContext, host: str, port: int) -> None:
        self._context = context
        self._name = f"TCP {host}:{port}"
        try:
            self._socket = socket.create_connection((host, port), timeout=CONNECT_S)
        except OSError as error:
            raise UnavailableError(f"{self._name}: {error.strerror or error}") from None
        self._socket.settimeout(CONNECT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def read(self) -> bytes:
        try:
            if not select.select([self._socket], [], [], READ_S)[0]:
                return b""
            data = self._socket.recv(_MOST_BYTES)
        except (OSError, ValueError) as error:
            raise UnavailableError(f"{self._name}: {error}") from None
        if not data:
            raise UnavailableError(f"{self._name}: the other end closed")
        return self._context.heard(data)

    def write(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise UnavailableError(f"{self._name}: {error.strerror or error}") from None

    def adopt(self) -> None:
        pass

    def close(self) -> None:
        self._socket.close()


def _resolved(host: str, port: int, kind: socket.SocketKind, name: str) -> tuple[int, tuple[str, int]]:
    try:
        family, _, _, _, address = socket.getaddrinfo(host, port, type=kind)[0]
    except OSError as error:
        raise UnavailableError(f"{name}: {error.strerror or error}") from None
    return family, (str(address[0]), int(address[1]))
