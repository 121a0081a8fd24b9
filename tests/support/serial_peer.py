"""An emulated device that answers on a pty, in a thread of its own, and sends while it scans."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from tests.support.pty_device import PtyDevice

__all__ = ["answering"]


@contextmanager
def answering(device: PtyDevice, heard: Callable[[bytes], object], sends: Callable[[], bytes]) -> Iterator[None]:
    """Hand what the driver writes to `heard`, and write what `sends` gives, until the block ends."""
    stop = threading.Event()

    def serve() -> None:
        while not stop.is_set():
            try:
                if data := device.read(0.005):
                    heard(data)
                device.write(sends())
            except OSError:  # unplugged this moment
                stop.wait(0.005)

    thread = threading.Thread(target=serve, name="emulated device")
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join(60)
        assert not thread.is_alive()
