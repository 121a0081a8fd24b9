"""A gamepad's bytes through a pipe in the file system: the kernel's records, without a kernel's gamepad."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from types import TracebackType

from metaros.drivers.joystick.events import DROPPED, EV_ABS, EV_KEY, EV_SYN, RECORD, REPORT
from tests.support.waiting import wait_until

TL = 0x136  # the left shoulder: button 4 of Joy


def record(kind: int, code: int, value: int) -> bytes:
    """One struct input_event."""
    return RECORD.pack(1_700_000_000, 123_456, kind, code, value)


class GamepadEmulator:
    """`path` is the driver's device; it is away until it is plugged in."""

    def __init__(self, folder: Path) -> None:
        self.link = folder / "event0"
        self.path = str(self.link)
        self._file = -1

    def plug(self) -> None:
        """It is there, and the driver has opened it."""
        os.mkfifo(self.link)
        wait_until(self._opened)

    def unplug(self) -> None:
        """It is gone."""
        self.link.unlink()
        os.close(self._file)
        self._file = -1

    def axis(self, code: int, value: int) -> None:
        """Move an axis."""
        self.write(record(EV_ABS, code, value) + record(EV_SYN, REPORT, 0))

    def button(self, code: int, value: int) -> None:
        """Press (1), let go (0)."""
        self.write(record(EV_KEY, code, value) + record(EV_SYN, REPORT, 0))

    def drop(self) -> None:
        """The kernel's buffer ran over."""
        self.write(record(EV_SYN, DROPPED, 0))

    def write(self, data: bytes) -> None:
        """Any bytes."""
        rest = memoryview(data)

        def written() -> bool:
            nonlocal rest
            with contextlib.suppress(BlockingIOError):
                rest = rest[os.write(self._file, rest[:4096]) :]
            return not rest

        wait_until(written, every_s=0.001)

    def __enter__(self) -> GamepadEmulator:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._file >= 0:
            self.unplug()

    def _opened(self) -> bool:
        """A pipe can be opened for writing once somebody reads it."""
        try:
            self._file = os.open(self.path, os.O_WRONLY | os.O_NONBLOCK)
        except OSError as problem:
            if problem.errno == errno.ENXIO:
                return False
            raise
        return True
