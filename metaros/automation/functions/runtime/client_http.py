"""HTTP/1.1 as our client speaks it to the Runtime API: one connection, one request at a time."""

from __future__ import annotations

import socket
from collections.abc import Mapping

__all__ = ["Connection", "RuntimeApiError"]

_STREAM = {
    "Lambda-Runtime-Function-Response-Mode": "streaming",
    "Transfer-Encoding": "chunked",
    "Trailer": "Lambda-Runtime-Function-Error-Type, Lambda-Runtime-Function-Error-Body",
}


class RuntimeApiError(Exception):
    """The Runtime API is gone, or did not take what it was told: the worker ends."""


class Connection:
    """To the Runtime API at `host:port`."""

    def __init__(self, api: str) -> None:
        host, _, port = api.rpartition(":")
        self._host = api
        self._socket = socket.create_connection((host, int(port)))
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._rest = b""

    def get(self, target: str) -> tuple[dict[str, str], bytes]:
        """Ask; waits without a limit.

        Raises:
            RuntimeApiError: there was no answer, or not 200.
        """
        self._send(f"GET {target} HTTP/1.1\r\nHost: {self._host}\r\n\r\n".encode())
        status, headers, body = self._answer()
        if status != 200:
            raise RuntimeApiError(f"GET {target}: {status}: {body[:1024]!r}")
        return headers, body

    def post(self, target: str, body: bytes, headers: Mapping[str, str], *, refused_ok: bool = False) -> None:
        """Tell. `refused_ok`: what is refused (too large) was told to the caller by the other side.

        Raises:
            RuntimeApiError: there was no answer, or it was refused.
        """
        head = self._head(target, {**headers, "Content-Length": str(len(body))})
        if len(body) < 65_536:
            self._send(head + body)
        else:
            self._send(head)
            self._send(body)
        status, _, answer = self._answer()
        if status != 202 and not (refused_ok and status == 413):
            raise RuntimeApiError(f"POST {target}: {status}: {answer[:1024]!r}")

    def begin_chunks(self, target: str, headers: Mapping[str, str]) -> None:
        """Begin a streamed answer."""
        self._send(self._head(target, {**headers, **_STREAM}))

    def chunk(self, piece: bytes) -> None:
        """A piece of it."""
        if piece:
            self._send(b"%x\r\n%b\r\n" % (len(piece), piece))

    def end_chunks(self, trailers: Mapping[str, str]) -> None:
        """Its end."""
        tail = "".join(f"{name}: {value}\r\n" for name, value in trailers.items())
        self._send(f"0\r\n{tail}\r\n".encode())
        status, _, answer = self._answer()
        if status not in (202, 413):
            raise RuntimeApiError(f"streamed answer: {status}: {answer[:1024]!r}")

    def _head(self, target: str, headers: Mapping[str, str]) -> bytes:
        lines = "".join(f"{name}: {value}\r\n" for name, value in headers.items() if value)
        return f"POST {target} HTTP/1.1\r\nHost: {self._host}\r\n{lines}\r\n".encode()

    def _send(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise RuntimeApiError(f"the Runtime API is gone: {error}") from error

    def _more(self) -> bytes:
        try:
            data = self._socket.recv(262_144)
        except OSError as error:
            raise RuntimeApiError(f"the Runtime API is gone: {error}") from error
        if not data:
            raise RuntimeApiError("the Runtime API is gone")
        return data

    def _answer(self) -> tuple[int, dict[str, str], bytes]:
        data = self._rest
        while (end := data.find(b"\r\n\r\n")) < 0:
            data += self._more()
        lines = data[:end].decode("latin-1").split("\r\n")
        headers = {}
        for line in lines[1:]:
            name, _, value = line.partition(":")
            headers[name.lower()] = value.strip()
        left = int(headers.get("content-length", "0")) - (len(data) - end - 4)
        pieces = [data[end + 4 :]]
        while left > 0:
            piece = self._more()
            pieces.append(piece)
            left -= len(piece)
        self._rest = b""
        return int(lines[0].split(" ", 2)[1]), headers, pieces[0] if len(pieces) == 1 else b"".join(pieces)
