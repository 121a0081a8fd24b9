"""A link that dies of what a robot does: too many bytes a second, or a program that takes the radio for itself."""

from __future__ import annotations

import contextlib
import socket
import time

from tests.support.servers.cutting_proxy import CuttingProxy

__all__ = ["WeakLink"]


class WeakLink(CuttingProxy):
    """Every connection breaks when more than `most_bytes` go up in a second, and while anybody is at `jam_port`.

    It is whole again by itself as soon as that is over; nobody mends it.
    """

    def __init__(self, target_port: int, *, most_bytes: int) -> None:
        super().__init__(target_port)
        self._most_bytes = most_bytes
        self._second_s, self._passed = 0.0, 0
        self._jam = socket.create_server(("127.0.0.1", 0))
        self._jammers = 0
        self.floods = self.jams = 0

    @property
    def jam_port(self) -> int:
        """Whoever connects here jams the link until it hangs up."""
        return int(self._jam.getsockname()[1])

    def __enter__(self) -> WeakLink:
        super().__enter__()
        self._start(self._watch_jammers)
        return self

    def __exit__(self, *error: object) -> None:
        self._ended = True
        self._jam.shutdown(socket.SHUT_RDWR)
        self._jam.close()
        super().__exit__(None, None, None)

    def _may_pass(self, way: str, count: int) -> bool:
        with self._lock:
            if self._jammers:
                self._break()
                return False
            if way == "down":
                return True
            if time.monotonic() - self._second_s >= 1.0:
                self._second_s, self._passed = time.monotonic(), 0
            self._passed += count
            if self._passed <= self._most_bytes:
                return True
            self.floods += 1
            self._break()
            return False

    def _watch_jammers(self) -> None:
        while not self._ended:
            try:
                jammer, _ = self._jam.accept()
            except OSError:
                return
            self._start(self._jammed_by, jammer)

    def _jammed_by(self, jammer: socket.socket) -> None:
        with self._lock:
            self._jammers += 1
            self.jams += 1
            self._break()
        with jammer:
            with contextlib.suppress(OSError):
                jammer.recv(1)
        with self._lock:
            self._jammers -= 1
