"""A gamepad's file in /dev/input: opened, asked what it has, read. Linux only.

Requests as in the kernel's include/uapi/linux/input.h: EVIOCGNAME, EVIOCGBIT, EVIOCGABS.
"""

from __future__ import annotations

import array
import contextlib
import os
import select
import struct
import sys
from typing import Final

from metaros.drivers.joystick.events import EV_ABS, EV_KEY
from metaros.drivers.joystick.layout import STANDARD, AxisRange, Layout
from metaros.errors import UnavailableError

__all__ = ["InputDevice", "read_request"]

_ABSINFO: Final = struct.Struct("@6i")
_ABS_CODES: Final = 0x40
_KEY_CODES: Final = 0x300
_FIRST_BUTTON: Final = 0x100  # below are the keys of keyboards


class InputDevice:
    """Reads without blocking long."""

    def __init__(self, path: str) -> None:
        """Raises UnavailableError: no such file now, or this user may not read it."""
        try:
            self._file = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
        except OSError as error:
            raise UnavailableError(f"{path}: {error.strerror}") from None
        self.path = path
        self.layout = self._ask()

    def read(self, timeout_s: float) -> bytes:
        """What came within that time. UnavailableError when the device has gone."""
        ready, _, _ = select.select([self._file], [], [], max(0.0, timeout_s))
        if not ready:
            return b""
        try:
            data = os.read(self._file, 4096)
        except BlockingIOError:
            return b""
        except OSError as error:
            raise UnavailableError(f"{self.path}: {error.strerror}") from None
        if not data:
            raise UnavailableError(f"{self.path}: it has gone")
        return data

    def close(self) -> None:
        """Let it go."""
        file, self._file = self._file, -1
        if file >= 0:
            with contextlib.suppress(OSError):
                os.close(file)

    def _ask(self) -> Layout:
        """What it has; the standard layout for what is no input device."""
        try:
            name = self._request(0x06, 256).split(b"\0")[0].decode(errors="replace")
            axes = {}
            for code in _bits(self._request(0x20 + EV_ABS, _ABS_CODES // 8)):
                value, low, high, *_ = _ABSINFO.unpack(self._request(0x40 + code, _ABSINFO.size))
                axes[code] = AxisRange(low, high, value)
            keys = _bits(self._request(0x20 + EV_KEY, _KEY_CODES // 8))
        except OSError:
            return STANDARD
        return Layout(name, axes, tuple(code for code in keys if code >= _FIRST_BUTTON))

    def _request(self, number: int, size_bytes: int) -> bytes:
        if sys.platform != "linux":
            raise OSError("only Linux has it")
        else:
            import fcntl

            buffer = array.array("B", bytes(size_bytes))
            fcntl.ioctl(self._file, read_request(number, size_bytes), buffer)
            return buffer.tobytes()


def read_request(number: int, size_bytes: int) -> int:
    """The kernel's _IOC(_IOC_READ, 'E', number, size)."""
    return 2 << 30 | size_bytes << 16 | ord("E") << 8 | number


def _bits(mask: bytes) -> list[int]:
    return [8 * at + bit for at, byte in enumerate(mask) for bit in range(8) if byte >> bit & 1]
