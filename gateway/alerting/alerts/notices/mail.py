"""A notice by mail: SMTP (RFC 5321) as far as handing in one mail needs it, on the event loop.

With STARTTLS what came before the handshake is forgotten, as RFC 3207 asks: it is read by another reader.
"""

from __future__ import annotations

import asyncio
import base64
import ssl

from gateway.alerting.alerts.notices.route import PRIVATE_HINT, Mailbox
from gateway.outbound.reach import address_of

__all__ = ["MailError", "send"]

LINE_BYTES = 4096
LINES = 100  # of one reply


class MailError(Exception):
    """The server does not take the mail; `status` is its code, 0 where what it said is none."""

    def __init__(self, message: str, *, status: int = 0) -> None:
        super().__init__(message)
        self.status = status


async def send(mailbox: Mailbox, mail: bytes) -> int:
    """Hand in a mail; the server's last status.

    Raises:
        MailError: the server refuses, or does not offer what the route asks.
        OSError: it cannot be reached, or not there where notices may go.
    """
    address = await address_of(mailbox.host, mailbox.port, private=mailbox.private, hint=PRIVATE_HINT)
    wrapped = mailbox.tls == "tls"
    reader, writer = await asyncio.open_connection(
        address,
        mailbox.port,
        ssl=_context(mailbox) if wrapped else None,
        server_hostname=mailbox.host if wrapped else None,
        limit=LINE_BYTES,
    )
    talk = SmtpSession(reader, writer)
    try:
        await talk.expect(220)
        offers = await talk.greet()
        if mailbox.tls == "starttls":
            if "STARTTLS" not in offers:
                raise MailError("the server does not offer STARTTLS")
            await talk.command("STARTTLS", 220)
            await talk.secure(_context(mailbox), mailbox.host)
            offers = await talk.greet()
        if mailbox.user:
            await _sign_in(talk, mailbox, offers)
        return await _hand_in(talk, mailbox, mail)
    finally:
        talk.abort()


class SmtpSession:
    """One SMTP connection: commands out, replies in."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader = reader
        self._writer = writer

    async def expect(self, *wanted: int) -> tuple[int, list[str]]:
        """The next reply, its status and its lines; MailError where the status is another."""
        lines: list[str] = []
        while len(lines) < LINES:
            try:
                line = (await self._reader.readuntil(b"\n")).decode("utf-8", "replace").rstrip("\r\n")
            except (asyncio.IncompleteReadError, asyncio.LimitOverrunError) as error:
                raise MailError("the server ended the connection, or says too much") from error
            status = int(line[:3]) if line[:3].isascii() and line[:3].isdigit() else 0
            lines.append(line[4:])
            if line[3:4] != "-":
                if status not in wanted:
                    raise MailError(f"the server says {line[:200]!r}", status=status)
                return status, lines
        raise MailError("the server says too much")

    async def command(self, line: str, *wanted: int) -> tuple[int, list[str]]:
        """A command, and the reply to it."""
        await self.write(line.encode() + b"\r\n")
        return await self.expect(*wanted)

    async def write(self, data: bytes) -> None:
        """Bytes as they are."""
        self._writer.write(data)
        await self._writer.drain()

    async def greet(self) -> dict[str, list[str]]:
        """What the server offers: the words behind each keyword."""
        _, lines = await self.command("EHLO metaros.invalid", 250)
        words = [line.upper().split() for line in lines[1:]]
        return {item[0]: item[1:] for item in words if item}

    async def secure(self, context: ssl.SSLContext, host: str) -> None:
        """TLS from here on, with a reader that knows nothing of before."""
        loop = asyncio.get_running_loop()
        reader = asyncio.StreamReader(limit=LINE_BYTES, loop=loop)
        protocol = asyncio.StreamReaderProtocol(reader, loop=loop)
        transport = await loop.start_tls(self._writer.transport, protocol, context, server_hostname=host)
        if transport is None:
            raise ConnectionError("the connection ended during the TLS handshake")
        protocol.connection_made(transport)
        self._reader, self._writer = reader, asyncio.StreamWriter(transport, protocol, reader, loop)

    def abort(self) -> None:
        """Let the connection go at once."""
        self._writer.transport.abort()


async def _sign_in(talk: SmtpSession, mailbox: Mailbox, offers: dict[str, list[str]]) -> None:
    ways = offers.get("AUTH", [])
    user, password = mailbox.user.encode(), mailbox.password.encode()
    if "PLAIN" in ways:
        await talk.command(f"AUTH PLAIN {_base64(bytes(1) + user + bytes(1) + password)}", 235)
    elif "LOGIN" in ways:
        await talk.command("AUTH LOGIN", 334)
        await talk.command(_base64(user), 334)
        await talk.command(_base64(password), 235)
    else:
        raise MailError("the server offers neither AUTH PLAIN nor AUTH LOGIN")


async def _hand_in(talk: SmtpSession, mailbox: Mailbox, mail: bytes) -> int:
    await talk.command(f"MAIL FROM:<{mailbox.sender}>", 250)
    refused: list[MailError] = []
    for recipient in mailbox.to:
        try:
            await talk.command(f"RCPT TO:<{recipient}>", 250, 251)
        except MailError as error:
            refused.append(error)
    if len(refused) == len(mailbox.to):
        raise refused[0]
    await talk.command("DATA", 354)
    lines = mail.removesuffix(b"\r\n").split(b"\r\n")
    await talk.write(b"".join(b"." * line.startswith(b".") + line + b"\r\n" for line in lines) + b".\r\n")
    status, _ = await talk.expect(250)
    await talk.write(b"QUIT\r\n")
    return status


def _base64(data: bytes) -> str:
    return base64.b64encode(data).decode()


def _context(mailbox: Mailbox) -> ssl.SSLContext:
    return mailbox.context or ssl.create_default_context()
