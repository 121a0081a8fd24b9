"""An emulated device that answers on a pty, in a thread of its own, and sends while it scans."""

from __future__ import annotations

import os
import select
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tests.support.devices.pty_device import PtyDevice

__all__ = ["answering"]


@contextmanager
def answering(device: PtyDevice, heard: Callable[[bytes], object], sends: Callable[[], bytes]) -> Iterator[None]:
    """Hand what the driver writes to `heard`, and write what `sends` gives, until the block ends."""
    stop = threading.Event()

    def serve() -> None:
        rest = b""
        while not stop.is_set():
            try:
                if data := device.read(0.002):
                    heard(data)
                rest = _written(device, rest or sends())
            except (OSError, ValueError):  # unplugged this moment
                rest = b""
                stop.wait(0.005)

    thread = threading.Thread(target=serve, name="emulated device")
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(60)
        assert not thread.is_alive()


def _written(device: PtyDevice, data: bytes) -> bytes:
    """Write some of it; what is left, all while the driver does not read."""
    if data and select.select([], [device.master], [], 0.01)[1]:
        return data[os.write(device.master, data[:2048]) :]
    return data
