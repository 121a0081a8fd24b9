"""A serial device for tests: a pty whose end that the driver opens can be unplugged, and plugged in again."""

from __future__ import annotations

import contextlib
import errno
import os
import select
import tty
from pathlib import Path
from types import TracebackType

__all__ = ["PtyDevice"]


class PtyDevice:
    """`path` is the driver's port, whether it is plugged in or not; the rest is the device's end."""

    def __init__(self, folder: Path, *, name: str = "ttyTEST0", plugged: bool = True) -> None:
        self.link = folder / name
        self.path = str(self.link)
        self.master = -1
        self._slave = -1
        if plugged:
            self.replug()

    def replug(self) -> None:
        """The device is there, with nothing waiting in either direction."""
        assert self.master < 0, "it is plugged in"
        self.master, self._slave = os.openpty()
        tty.setraw(self.master)
        tty.setraw(self._slave)  # kept open, so that a driver that comes and goes hangs nothing up
        fresh = self.link.with_suffix(".new")
        fresh.symlink_to(os.ttyname(self._slave))
        fresh.replace(self.link)

    def unplug(self) -> None:
        """The device is gone: whoever has the port open hears so at once."""
        self.link.unlink(missing_ok=True)
        for end in (self._slave, self.master):
            if end >= 0:
                os.close(end)
        self.master = self._slave = -1

    def write(self, data: bytes) -> None:
        """Send all to the driver, waiting while the line is full; what an unplugged device sends goes nowhere."""
        rest = memoryview(data)
        while rest and self.master >= 0:
            _, ready, _ = select.select([], [self.master], [], 60.0)
            assert ready, "the driver does not read"
            rest = rest[os.write(self.master, rest[:2048]) :]

    def read(self, timeout_s: float = 0.01) -> bytes:
        """What the driver sent, waiting at most so long for something."""
        if self.master < 0 or not select.select([self.master], [], [], timeout_s)[0]:
            return b""
        try:
            return os.read(self.master, 65536)
        except OSError as error:
            if error.errno in (errno.EIO, errno.EBADF):
                return b""
            raise

    def close(self) -> None:
        """The end of the test."""
        with contextlib.suppress(OSError):
            self.unplug()

    def __enter__(self) -> PtyDevice:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
