"""A TCP proxy to one port of this machine that is cut in the middle of a transfer, and mended."""

from __future__ import annotations

import contextlib
import socket
import threading
from types import TracebackType

__all__ = ["CuttingProxy"]


class CuttingProxy:
    """Use as a context manager; counts the bytes that go up and that come down."""

    def __init__(self, target_port: int) -> None:
        self._target_port = target_port
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._lock = threading.Lock()
        self._open: set[socket.socket] = set()
        self._threads: list[threading.Thread] = []
        self._left: dict[str, int | None] = {"up": None, "down": None}
        self._down = self._once = False
        self._ended = False
        self.cuts = 0

    @property
    def port(self) -> int:
        """Where it listens."""
        return int(self._listener.getsockname()[1])

    def cut_after(self, *, up: int | None = None, down: int | None = None, once: bool = False) -> None:
        """Break every connection after so many more bytes; new ones are refused then, unless it is `once`."""
        with self._lock:
            self._left, self._once = {"up": up, "down": down}, once

    def mend(self) -> None:
        """Connections work again."""
        with self._lock:
            self._left, self._down = {"up": None, "down": None}, False

    def __enter__(self) -> CuttingProxy:
        self._start(self._accept)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._ended = True
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        with self._lock:
            self._break()
        for thread in list(self._threads):
            thread.join(60)

    def _accept(self) -> None:
        while not self._ended:
            try:
                near, _ = self._listener.accept()
            except OSError:
                return
            if self._down:
                near.close()
                continue
            try:
                far = socket.create_connection(("127.0.0.1", self._target_port), 5)
                far.settimeout(None)
            except OSError:
                near.close()
                continue
            with self._lock:
                self._open |= {near, far}
            self._start(self._copy, near, far, "up")
            self._start(self._copy, far, near, "down")

    def _copy(self, source: socket.socket, target: socket.socket, way: str) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(16384):
                if not self._may_pass(way, len(data)):
                    break
                target.sendall(data)
        with self._lock:
            for end in (source, target):
                self._open.discard(end)
                _close(end)

    def _may_pass(self, way: str, count: int) -> bool:
        with self._lock:
            left = self._left[way]
            if left is None:
                return True
            if count <= left:
                self._left[way] = left - count
                return True
            self.cuts += 1
            self._left, self._down = {"up": None, "down": None}, not self._once
            self._break()
            return False

    def _break(self) -> None:
        for end in self._open:
            _close(end)
        self._open.clear()

    def _start(self, target: object, *arguments: object) -> None:
        assert callable(target)
        thread = threading.Thread(target=target, args=arguments, daemon=True)
        self._threads.append(thread)
        thread.start()


def _close(end: socket.socket) -> None:
    with contextlib.suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)
    end.close()
