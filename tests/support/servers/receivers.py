"""Where notices go in tests: a small HTTP server and a small SMTP server, both real, with TLS where it is asked."""

from __future__ import annotations

import asyncio
import base64
import ssl
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson

__all__ = ["HttpReceiver", "SmtpReceiver", "http_receiver", "server_context", "smtp_receiver"]

Serve = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


def server_context(certificate: Path) -> ssl.SSLContext:
    """A server's side of TLS with a pair as `make_certificate` writes it."""
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, certificate.with_suffix(".key"))
    return context


@dataclass
class HttpReceiver:
    """Keeps what is posted; answers with the next of `answers` while there are any, then with 204."""

    port: int = 0
    answers: list[bytes] = field(default_factory=list)
    requests: list[tuple[str, dict[str, str], bytes]] = field(default_factory=list)
    silent: bool = False

    @property
    def documents(self) -> list[dict[str, Any]]:
        """The bodies that came."""
        return [orjson.loads(body) for _, _, body in self.requests]

    @property
    def types(self) -> list[str]:
        """The last word of each document's type."""
        return [item["type"].rpartition(".")[2] for item in self.documents]

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection."""
        head = (await reader.readuntil(b"\r\n\r\n")).decode().split("\r\n")
        headers = {key.lower(): value for key, _, value in (line.partition(": ") for line in head[1:] if line)}
        body = await reader.readexactly(int(headers.get("content-length", "0")))
        self.requests.append((head[0], headers, body))
        if self.silent:
            await reader.read()
            return
        writer.write(self.answers.pop(0) if self.answers else b"HTTP/1.1 204 No Content\r\n\r\n")
        await writer.drain()


@dataclass
class SmtpReceiver:
    """Takes mail as RFC 5321 says; `refuse` maps the first word of a command to the reply that it gets instead."""

    port: int = 0
    tls: ssl.SSLContext | None = None  # offered as STARTTLS
    ways: str = "PLAIN LOGIN"
    mails: list[tuple[str, list[str], bytes]] = field(default_factory=list)
    signed_in: list[bytes] = field(default_factory=list)
    commands: list[str] = field(default_factory=list)
    refuse: dict[str, str] = field(default_factory=dict)
    injected: bytes = b""  # sent in plain right behind the answer to STARTTLS

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection."""
        await Mailman(self, reader, writer).run()


class Mailman:
    """One client's conversation."""

    def __init__(self, receiver: SmtpReceiver, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.receiver, self.reader, self.writer = receiver, reader, writer
        self.sender, self.to = "", list[str]()
        self.secure = writer.get_extra_info("ssl_object") is not None

    async def run(self) -> None:
        """Until it says QUIT, or leaves."""
        await self.reply("220 test ESMTP")
        while line := (await self.reader.readline()).decode().strip():
            word = line.split(" ")[0].split(":")[0].upper()
            self.receiver.commands.append(line)
            if refusal := self.receiver.refuse.get(line, self.receiver.refuse.get(word, "")):
                await self.reply(refusal)
            elif word == "QUIT":
                return
            else:
                await getattr(self, f"on_{word.lower()}")(line)

    async def reply(self, text: str) -> None:
        self.writer.write(text.encode() + b"\r\n")
        await self.writer.drain()

    async def on_ehlo(self, line: str) -> None:
        offers = ["test", "8BITMIME"]
        offers += ["STARTTLS"] if self.receiver.tls is not None and not self.secure else []
        offers += [f"AUTH {self.receiver.ways}"] if self.secure and self.receiver.ways else []
        for offer in offers[:-1]:
            await self.reply(f"250-{offer}")
        await self.reply(f"250 {offers[-1]}")

    async def on_starttls(self, line: str) -> None:
        assert self.receiver.tls is not None
        self.writer.write(b"220 go ahead\r\n" + self.receiver.injected)
        await self.writer.start_tls(self.receiver.tls)
        self.secure = True

    async def on_auth(self, line: str) -> None:
        _, way, *rest = line.split(" ")
        if way == "PLAIN":
            self.receiver.signed_in.append(base64.b64decode(rest[0]))
        else:
            for _ in range(2):
                await self.reply("334 VXNlcm5hbWU6")
                self.receiver.signed_in.append(base64.b64decode(await self.reader.readline()))
        await self.reply("235 welcome")

    async def on_mail(self, line: str) -> None:
        self.sender, self.to = line.partition(":")[2], []
        await self.reply("250 ok")

    async def on_rcpt(self, line: str) -> None:
        self.to.append(line.partition(":")[2])
        await self.reply("250 ok")

    async def on_data(self, line: str) -> None:
        await self.reply("354 go on")
        mail = await self.reader.readuntil(b"\r\n.\r\n")
        self.receiver.mails.append((self.sender, self.to, mail.removesuffix(b".\r\n").replace(b"\r\n..", b"\r\n.")))
        await self.reply("250 queued")


@asynccontextmanager
async def http_receiver(context: ssl.SSLContext | None = None) -> AsyncIterator[HttpReceiver]:
    """One that listens on this machine."""
    receiver = HttpReceiver()
    async with _listening(receiver.serve, context) as receiver.port:
        yield receiver


@asynccontextmanager
async def smtp_receiver(
    *, starttls: ssl.SSLContext | None = None, wrapped: ssl.SSLContext | None = None
) -> AsyncIterator[SmtpReceiver]:
    """One that listens on this machine."""
    receiver = SmtpReceiver(tls=starttls)
    async with _listening(receiver.serve, wrapped) as receiver.port:
        yield receiver


@asynccontextmanager
async def _listening(serve: Serve, context: ssl.SSLContext | None) -> AsyncIterator[int]:
    tasks: set[asyncio.Task[None]] = set()

    async def one(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        tasks.add(task)
        try:
            await serve(reader, writer)
        except (ConnectionError, asyncio.IncompleteReadError, ssl.SSLError):
            return
        finally:
            tasks.discard(task)
            writer.transport.abort()

    server = await asyncio.start_server(one, "127.0.0.1", 0, ssl=context)
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task in list(tasks):
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        await server.wait_closed()
