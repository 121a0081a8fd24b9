"""What a proxy has to know of HTTP/1.1: whom a request is for, how it goes on, and how it is refused.

`CONNECT` makes a tunnel. A plain `http://` request is handed on with its own body and nothing behind that, and its
answer says that the connection ends with it: what comes next on it could be for somebody else.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from dataclasses import dataclass
from urllib.parse import urlsplit

from metaros.automation.functions.egress.rules import address_of

__all__ = ["EgressRefusedError", "Target", "answer_head", "head", "refusal", "send_body", "target_of"]

PIECE_BYTES = 65_536
_REASONS = {400: "Bad Request", 403: "Forbidden", 431: "Request Header Fields Too Large"}
_REASONS |= {502: "Bad Gateway", 503: "Service Unavailable", 504: "Gateway Timeout"}
_HOST = re.compile(r"[A-Za-z0-9._:%-]{1,255}")
_METHOD = re.compile(rb"[A-Z]{1,32}")
_CONTROL = re.compile(rb"[\x00-\x20\x7f]")
_CHUNK = re.compile(rb"[0-9A-Fa-f]{1,15}")
# Of this connection alone, and what they name is so too.
_OWN = {b"connection", b"proxy-connection", b"keep-alive", b"proxy-authorization", b"te", b"upgrade", b"host"}


class EgressRefusedError(Exception):
    """The worker gets `status` and the reason, and its function's log the reason."""

    def __init__(self, status: int, reason: str) -> None:
        super().__init__(reason)
        self.status = status


@dataclass(frozen=True, slots=True)
class Target:
    """Whom a request is for. `request` is its head as the far end gets it; `body_bytes` None: in chunks."""

    host: str
    port: int
    tunnel: bool = True
    request: bytes = b""
    body_bytes: int | None = 0

    def __str__(self) -> str:
        return f"[{self.host}]:{self.port}" if ":" in self.host else f"{self.host}:{self.port}"


async def head(reader: asyncio.StreamReader, most_bytes: int, *, status: int = 431) -> list[bytes]:
    """The lines of the next head; EgressRefusedError with `status` where it is too long, also for the reader."""
    try:
        found = await reader.readuntil(b"\r\n\r\n")
    except asyncio.LimitOverrunError:
        found = b""
    if not found or len(found) > most_bytes:
        raise EgressRefusedError(status, f"a head of over {most_bytes} bytes")
    return found[:-4].split(b"\r\n")


def target_of(lines: list[bytes]) -> Target:
    """Whom this request is for; EgressRefusedError where it is none for a proxy."""
    words = lines[0].split(b" ")
    if (
        len(words) != 3
        or not words[2].startswith(b"HTTP/1.")
        or not _METHOD.fullmatch(words[0])
        or _CONTROL.search(words[1])
    ):
        raise EgressRefusedError(400, "no HTTP/1 request")
    method, url = words[0], words[1].decode("latin-1")
    try:
        parts = urlsplit(f"//{url}" if method == b"CONNECT" else url)
        host, port = _plain(parts.hostname or ""), parts.port
    except ValueError as error:
        raise EgressRefusedError(400, f"no address: {url[:200]!r}: {error}") from None
    if not _HOST.fullmatch(host) or port == 0:
        raise EgressRefusedError(400, f"no address: {url[:200]!r}")
    if method == b"CONNECT":
        if not port or parts.path or parts.query or "@" in url:
            raise EgressRefusedError(400, f"no HOST:PORT: {url[:200]!r}")
        return Target(host, port)
    if parts.scheme != "http":
        raise EgressRefusedError(400, f"a proxy takes CONNECT and http:// URLs, not {url[:200]!r}")
    path = (parts.path or "/") + (f"?{parts.query}" if parts.query else "")
    return _plain_request(method, path, host, port or 80, lines[1:])


def _plain(host: str) -> str:
    """A host as patterns write it."""
    address = address_of(host)
    return str(address) if address is not None else host.lower().removesuffix(".")


def _plain_request(method: bytes, path: str, host: str, port: int, lines: list[bytes]) -> Target:
    fields = _fields(lines)
    sizes = {value for name, value in fields if name == b"content-length"}
    codings = [value.lower() for name, value in fields if name == b"transfer-encoding"]
    if len(sizes) > 1 or (sizes and codings) or codings not in ([], [b"chunked"]):
        raise EgressRefusedError(400, "a body of no one size")
    size = sizes.pop() if sizes else b"0"
    if not size.isdigit() or len(size) > 15:
        raise EgressRefusedError(400, "a Content-Length that is no number")
    named = {word.strip().lower() for name, value in fields if name == b"connection" for word in value.split(b",")}
    kept = [name + b": " + value for name, value in fields if name not in _OWN | named]
    at = (f"[{host}]" if ":" in host else host) + (f":{port}" if port != 80 else "")
    first = [b"%s %s HTTP/1.1" % (method, path.encode("latin-1")), b"Host: " + at.encode()]
    request = b"\r\n".join([*first, *kept, b"Connection: close", b"", b""])
    return Target(host, port, False, request, None if codings else int(size))


def _fields(lines: list[bytes]) -> list[tuple[bytes, bytes]]:
    found = []
    for line in lines:
        name, colon, value = line.partition(b":")
        if not colon or not name or name.strip() != name or b"\n" in line or b"\r" in line:
            raise EgressRefusedError(400, f"no header: {line[:80]!r}")
        found.append((name.lower(), value.strip()))
    return found


async def send_body(
    target: Target, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, awake: Callable[[], None]
) -> None:
    """The body of a plain request, and nothing behind it; ConnectionError where it is none."""

    async def pass_on(left: int) -> None:
        while left:
            data = await reader.read(min(left, PIECE_BYTES))
            if not data:
                raise asyncio.IncompleteReadError(b"", left)
            left -= len(data)
            writer.write(data)
            await writer.drain()
            awake()

    async def line() -> bytes:
        try:
            found = await reader.readuntil(b"\r\n")
        except asyncio.LimitOverrunError:
            raise ConnectionError("a chunk's line is too long") from None
        writer.write(found)
        await writer.drain()  # lines without end, to who takes none of them, stay with who sends them
        return found

    if target.body_bytes is not None:
        await pass_on(target.body_bytes)
        return
    while True:
        word = (await line()).partition(b";")[0].strip()
        if not _CHUNK.fullmatch(word):
            raise ConnectionError("no chunk")
        if not int(word, 16):
            break
        await pass_on(int(word, 16) + 2)
    while await line() != b"\r\n":
        pass


async def answer_head(reader: asyncio.StreamReader, writer: asyncio.StreamWriter, most_bytes: int) -> bytes:
    """The head of an answer as the worker gets it; what precedes it (100 Continue) is written at once."""
    while True:
        lines = await head(reader, most_bytes, status=502)
        fields = [line for line in lines[1:] if line.partition(b":")[0].strip().lower() not in _OWN]
        if not lines[0].startswith(b"HTTP/1.1 1"):
            return b"\r\n".join([lines[0], *fields, b"Connection: close", b"", b""])
        writer.write(b"\r\n".join([lines[0], *fields, b"", b""]))
        await writer.drain()


def refusal(refused: EgressRefusedError) -> bytes:
    """The answer that says so."""
    body = f"Meta-ROS: {refused}\n".encode()
    line = f"HTTP/1.1 {refused.status} {_REASONS[refused.status]}"
    fields = f"Content-Type: text/plain; charset=utf-8\r\nContent-Length: {len(body)}\r\nConnection: close"
    return f"{line}\r\n{fields}\r\n\r\n".encode() + body
