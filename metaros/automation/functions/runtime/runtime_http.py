"""HTTP/1.1 as a worker speaks it to its Runtime API: bytes of one connection in, requests out.

An own reader instead of httptools, so that gateway, robot and Windows share one path: it has one client, which sends
heads of a MiB (X-Ray causes) and chunked bodies with trailers, and which can confuse nobody but itself. It is a
stranger all the same: it asks again once it has read the last answer, and the fields of a head are bounded in number.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field

from metaros.limits import LIMITS, Limits

__all__ = ["BadRequestError", "Request", "RequestReader", "reply"]

_LINE_BYTES = 4096  # of a chunk's size, with its extensions
_FIELDS = 128  # of a head: large ones are few
_CHUNK = re.compile(rb"[0-9A-Fa-f]{1,15}")
_REASONS = {200: "OK", 202: "Accepted", 400: "Bad Request", 403: "Forbidden", 404: "Not Found", 413: "Too Large"}


class BadRequestError(Exception):
    """The bytes are no request; the connection is of no further use."""


@dataclass(slots=True, eq=False)
class Request:
    """One request. Names of headers and trailers are in lower case. `body` is b"" where its pieces were handed on,
    or where it was too large (`cut`).
    """

    method: bytes
    target: bytes
    headers: dict[bytes, bytes]
    body: bytes = b""
    trailers: dict[bytes, bytes] = field(default_factory=dict)
    cut: bool = False


def reply(status: int, body: bytes, *, content_type: bytes = b"application/json") -> bytes:
    """A whole answer."""
    head = b"HTTP/1.1 %d %s\r\nContent-Type: %s\r\nContent-Length: %d\r\n\r\n"
    return head % (status, _REASONS[status].encode(), content_type, len(body)) + body


def _fields(lines: list[bytes]) -> dict[bytes, bytes]:
    fields = {}
    for line in lines:
        name, colon, value = line.partition(b":")
        if not colon:
            raise BadRequestError(f"no header: {line[:80]!r}")
        fields[name.lower()] = value.strip()
    return fields


class RequestReader:
    """`begun` is called with each request's head and may return who takes the body's pieces, else they are kept up to
    `function_response_bytes`; `done` with each whole request; `go_on` where the client waits before it sends the body.
    """

    def __init__(
        self,
        *,
        begun: Callable[[Request], Callable[[bytes], None] | None],
        done: Callable[[Request], None],
        go_on: Callable[[], None],
        limits: Limits = LIMITS,
    ) -> None:
        self._begun, self._done, self._go_on = begun, done, go_on
        self._head_bytes, self._body_bytes = limits.function_head_bytes, limits.function_response_bytes
        self._step: Callable[[bytes], bytes] = self._head
        self._held = bytearray()  # of a line or a head that is not whole yet
        self._request = Request(b"", b"", {})
        self._taker: Callable[[bytes], None] | None = None
        self._pieces: list[bytes] = []
        self._kept_bytes = 0
        self._left_bytes = 0  # of the body, or of its chunk
        self._ended = False  # with what came just now

    def feed(self, data: bytes) -> None:
        """Take what came.

        Raises:
            BadRequestError: it is no HTTP/1.1, a head over its limit, or behind a request is another one already.
        """
        self._ended = False
        while data:
            if self._ended:
                raise BadRequestError("a request comes once the one before it is answered")
            data = self._step(data)

    def _until(self, data: bytes, end: bytes, most_bytes: int) -> tuple[bytes, bytes] | None:
        """What is before `end` and what comes after it; None: not there yet."""
        if self._held:
            begin = max(0, len(self._held) - len(end) + 1)
            self._held += data
            at = self._held.find(end, begin)
            if 0 <= at <= most_bytes:
                whole, rest = bytes(self._held[:at]), bytes(self._held[at + len(end) :])
                self._held.clear()
                return whole, rest
        else:
            at = data.find(end)
            if 0 <= at <= most_bytes:
                return data[:at], data[at + len(end) :]
            self._held += data
        if at >= 0 or len(self._held) >= most_bytes + len(end):
            raise BadRequestError(f"a head of a request is over {most_bytes} bytes")
        return None

    def _head(self, data: bytes) -> bytes:
        found = self._until(data, b"\r\n\r\n", self._head_bytes)
        if found is None:
            return b""
        head, rest = found
        lines = head.split(b"\r\n", _FIELDS + 1)
        if len(lines) > _FIELDS + 1:
            raise BadRequestError(f"more than {_FIELDS} headers")
        words = lines[0].split(b" ")
        if len(words) != 3 or not words[2].startswith(b"HTTP/1."):
            raise BadRequestError(f"no request: {lines[0][:80]!r}")
        del lines[0]
        headers = _fields(lines)
        self._request = Request(words[0], words[1], headers)
        self._body_of(headers)
        return rest

    def _body_of(self, headers: dict[bytes, bytes]) -> None:
        chunked = headers.get(b"transfer-encoding", b"").lower() == b"chunked"
        length = headers.get(b"content-length", b"0")
        if not length.isdigit() or len(length) > 18:
            raise BadRequestError(f"no length: {length[:80]!r}")
        self._left_bytes = int(length)
        if not chunked and not self._left_bytes:
            self._begun(self._request)
            self._end()
            return
        self._taker = self._begun(self._request)
        if b"expect" in headers:
            self._go_on()
        self._step = self._size if chunked else self._sized

    def _take(self, piece: bytes) -> None:
        if self._taker is not None:
            self._taker(piece)
            return
        self._kept_bytes += len(piece)
        if self._kept_bytes > self._body_bytes:
            self._request.cut = True
            self._pieces.clear()  # the rest is read and dropped: the client hears of it at its end
        else:
            self._pieces.append(piece)

    def _sized(self, data: bytes) -> bytes:
        piece = data[: self._left_bytes] if len(data) > self._left_bytes else data
        self._left_bytes -= len(piece)
        self._take(piece)
        if not self._left_bytes:
            self._end()
        return data[len(piece) :]

    def _size(self, data: bytes) -> bytes:
        found = self._until(data, b"\r\n", _LINE_BYTES)
        if found is None:
            return b""
        size = found[0].partition(b";")[0].strip()
        if not _CHUNK.fullmatch(size):
            raise BadRequestError(f"no chunk: {found[0][:80]!r}")
        self._left_bytes = int(size, 16)
        self._step = self._chunk if self._left_bytes else self._trailer
        return found[1]

    def _chunk(self, data: bytes) -> bytes:
        piece = data[: self._left_bytes]
        self._left_bytes -= len(piece)
        self._take(piece)
        if not self._left_bytes:
            self._step = self._chunk_end
        return data[len(piece) :]

    def _chunk_end(self, data: bytes) -> bytes:
        found = self._until(data, b"\r\n", 0)
        if found is None:
            return b""
        self._step = self._size
        return found[1]

    def _trailer(self, data: bytes) -> bytes:
        found = self._until(data, b"\r\n", self._head_bytes)
        if found is None:
            return b""
        if found[0]:
            self._request.trailers.update(_fields([found[0]]))
            if len(self._request.trailers) > 64:
                raise BadRequestError("more than 64 trailers")
        else:
            self._end()
        return found[1]

    def _end(self) -> None:
        request = self._request
        request.body = self._pieces[0] if len(self._pieces) == 1 else b"".join(self._pieces)
        self._pieces, self._kept_bytes, self._taker = [], 0, None
        self._step = self._head
        self._ended = True
        self._done(request)
