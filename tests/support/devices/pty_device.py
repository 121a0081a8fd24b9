"""A serial device for tests: a pty whose end that the driver opens can be unplugged, and plugged in again."""

from __future__ import annotations

import contextlib
import errno
import os
import select
import threading
import time
import tty
from pathlib import Path
from types import TracebackType

__all__ = ["PtyDevice"]


class PtyDevice:
    """`path` is the driver's port, whether it is plugged in or not; the rest is the device's end. One thread may read,
    one write and one unplug: nobody uses a descriptor that another closes.
    """

    def __init__(self, folder: Path, *, name: str = "ttyTEST0", plugged: bool = True) -> None:
        self.link = folder / name
        self.path = str(self.link)
        self.master = -1
        self._slave = -1
        self._reading, self._writing = threading.Lock(), threading.Lock()
        self._going = False  # who reads in a loop makes way for who unplugs
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
        self._going = True
        with self._reading, self._writing:
            for end in (self._slave, self.master):
                if end >= 0:
                    os.close(end)
            self.master = self._slave = -1
            self._going = False

    def write(self, data: bytes) -> None:
        """Send all to the driver, waiting while the line is full; what an unplugged device sends goes nowhere."""
        rest, until_s = memoryview(data), time.monotonic() + 60.0
        while rest and not self._going:
            with self._writing:
                if self.master < 0:
                    return
                _, ready, _ = select.select([], [self.master], [], 0.01)
                assert ready or time.monotonic() < until_s, "the driver does not read"
                if ready:
                    rest = rest[os.write(self.master, rest[:2048]) :]

    def read(self, timeout_s: float = 0.01) -> bytes:
        """What the driver sent, waiting at most so long for something."""
        if self._going:
            return b""
        with self._reading:
            if self.master < 0 or not select.select([self.master], [], [], timeout_s)[0]:
                return b""
            try:
                return os.read(self.master, 65536)
            except OSError as error:
                if error.errno == errno.EIO:
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
