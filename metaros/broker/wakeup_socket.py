"""A self-pipe: wakes a thread that waits in a poller, from any other thread."""

from __future__ import annotations

import socket
from contextlib import suppress

__all__ = ["WakeupSocket"]


class WakeupSocket:
    """A pair of sockets: the poller waits on `fileno()`. One byte stands for any number of wakes."""

    def __init__(self) -> None:
        self._read, self._write = socket.socketpair()
        self._read.setblocking(False)
        self._write.setblocking(False)
        self._awake = False

    def fileno(self) -> int:
        """What the poller waits on."""
        return self._read.fileno()

    def wake(self) -> None:
        """End the wait. What it is about must be in place before."""
        if not self._awake:
            self._awake = True
            with suppress(OSError):  # full, or closed: the reader is awake, or gone
                self._write.send(b"\0")

    def clear(self) -> None:
        """Before looking at what there is: a wake that comes from now on counts anew."""
        with suppress(BlockingIOError):
            self._read.recv(4096)
        self._awake = False

    def close(self) -> None:
        """Give the sockets back."""
        self._read.close()
        self._write.close()
