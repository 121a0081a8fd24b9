"""A serial port as drivers use it: reads that never block long, and UnavailableError when the device is gone."""

from __future__ import annotations

import contextlib
import sys
from typing import Any, Final

from metaros.drivers.context import DriverContext
from metaros.errors import ConfigError, UnavailableError

__all__ = ["SerialPort"]

READ_S: Final = 0.1
WRITE_S: Final = 1.0


def _errors() -> tuple[type[Exception], ...]:
    """pyserial's own errors are OSError; those of termios, which it lets through when a port goes, are not."""
    if sys.platform == "win32":
        return (OSError,)
    else:
        import termios

        return (OSError, termios.error)


_ERRORS: Final = _errors()
_GONE: Final[tuple[type[Exception], ...]] = (*_ERRORS, TypeError, AttributeError)  # the last two: closed meanwhile


class SerialPort:
    """Opened on the driver's thread; `write` may come from another."""

    def __init__(self, context: DriverContext, port: str, baud: int, *, parity: str = "N", stop_bits: int = 1) -> None:
        """Eight data bits; `parity` is N, E or O. Raises UnavailableError: no such port now; ConfigError: a port or
        rate that can never be.
        """
        import serial

        self._context = context
        self.port = port
        if not port:
            raise ConfigError(f"{context.manifest.kind}: port is empty; `metaros driver probe` lists serial ports")
        try:
            self._serial: Any = serial.serial_for_url(
                port,
                baud,
                parity=parity,
                stopbits=stop_bits,
                timeout=READ_S,
                write_timeout=WRITE_S,
                exclusive=None if _is_url(port) else True,
            )
        except ValueError as error:
            raise ConfigError(f"{port}: {error}") from None
        except _ERRORS as error:
            raise UnavailableError(f"{port}: {_reason(error)}") from None

    def read(self, at_most: int = 4096) -> bytes:
        """What came, at most READ_S waited for; nothing when nothing came."""
        try:
            waiting = self._serial.in_waiting
            data = bytes(self._serial.read(max(1, min(waiting, at_most))))
        except _GONE as error:
            raise UnavailableError(f"{self.port}: {_reason(error)}") from None
        return self._context.heard(data) if data else data

    def write(self, data: bytes) -> None:
        """Send all of it."""
        try:
            self._serial.write(data)
        except _GONE as error:
            raise UnavailableError(f"{self.port}: {_reason(error)}") from None

    def discard(self) -> None:
        """Forget what has come so far; a port that is gone says so at the next read or write."""
        with contextlib.suppress(*_GONE):
            self._serial.reset_input_buffer()

    def set_dtr(self, on: bool) -> None:
        """Set the DTR line, which turns some devices' motors; a port that has none does not mind."""
        with contextlib.suppress(*_ERRORS):
            self._serial.dtr = on

    def close(self) -> None:
        """Let it go."""
        with contextlib.suppress(*_ERRORS):
            self._serial.close()


def _is_url(port: str) -> bool:
    return "://" in port


def _reason(error: Exception) -> str:
    if "returned no data" in str(error):  # pyserial's guess at why a port is ready and empty
        return "unplugged"
    return getattr(error, "strerror", None) or str(error) or type(error).__name__
