"""Asks a gateway over plain HTTP: for tables of thousands of requests, of whose time `httpx` would take the half."""

from __future__ import annotations

import asyncio
import json
import ssl
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager

__all__ = ["FREE", "TRUSTS_NOBODY", "PlainHttp", "plain_http"]

TRUSTS_NOBODY = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)  # for httpx: to read all roots takes 50 ms a client
# Settings of a gateway that is to answer all of them: nobody asks too often.
FREE = {"requests_per_s": 0.0, "anonymous_requests_per_s": 0.0, "robot_requests_per_s": 0.0, "sign_ins_per_min": 0.0}
MOST_BYTES = 8 * 1024 * 1024


class PlainHttp:
    """One connection, made again where the gateway closed it; headers are written as they are given."""

    def __init__(self, port: int, headers: Mapping[str, str]) -> None:
        self._port, self._headers = port, {"Host": f"127.0.0.1:{port}", **headers}
        self._pair: tuple[asyncio.StreamReader, asyncio.StreamWriter] | None = None

    async def ask(self, method: str, path: str, body: bytes | None = None, **headers: str) -> tuple[int, str]:
        """The status of an answer, and the code of a refusal."""
        status, content = await self.request(method, path, body, headers)
        if status < 400:
            return status, ""
        document = json.loads(content) if content else {}
        return status, str(document.get("code", ""))

    async def request(
        self, method: str, path: str, body: bytes | None = None, headers: Mapping[str, str] | None = None
    ) -> tuple[int, bytes]:
        """The status and the body of an answer."""
        length = {} if body is None else {"Content-Length": str(len(body))}
        lines = {**self._headers, **length, **(headers or {})}
        head = "".join(f"{name}: {value}\r\n" for name, value in lines.items())
        asked = f"{method} {path} HTTP/1.1\r\n{head}\r\n".encode("latin-1") + (body or b"")
        async with asyncio.timeout(60):
            if self._pair is None or self._pair[0].at_eof():
                await self.close()
                self._pair = await asyncio.open_connection("127.0.0.1", self._port, limit=MOST_BYTES)
            reader, writer = self._pair
            writer.write(asked)
            first, *fields = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1").split("\r\n")
            said = dict(field.lower().split(": ", 1) for field in fields if field)
            content = b"" if method == "HEAD" else await _content(reader, said)
            if said.get("connection") == "close":
                await self.close()
        return int(first.split(" ")[1]), content

    async def close(self) -> None:
        """End the connection."""
        if self._pair is not None:
            self._pair[1].close()
            self._pair = None


async def _content(reader: asyncio.StreamReader, said: Mapping[str, str]) -> bytes:
    if said.get("transfer-encoding") != "chunked":
        return await reader.readexactly(int(said.get("content-length", "0")))
    pieces = []
    while size := int(await reader.readline(), 16):
        pieces.append(await reader.readexactly(size))
        await reader.readline()
    await reader.readline()
    return b"".join(pieces)


@asynccontextmanager
async def plain_http(port: int, headers: Mapping[str, str] | None = None) -> AsyncIterator[PlainHttp]:
    """A client of that port; `headers` go with each request."""
    http = PlainHttp(port, headers or {})
    try:
        yield http
    finally:
        await http.close()
