"""Requests to an identity provider: bounded in bytes and time, without redirects, and only to where they may go.

The provider's own documents say which addresses to ask next. So a host that is not the configured issuer's must have
public addresses only: nobody leads the gateway into the network it stands in. The address that was looked at is the
one that is used.
"""

from __future__ import annotations

import asyncio
import ipaddress
import socket
import ssl
from dataclasses import dataclass
from urllib.parse import SplitResult, urlsplit

import h11

from gateway.identity.errors import ProviderError

__all__ = ["UrlPolicy", "fetch"]

TIMEOUT_S = 10.0
PIECE_BYTES = 16 * 1024


@dataclass(frozen=True, slots=True)
class UrlPolicy:
    """Which URLs may be requested: https to public hosts and the issuer; plain http only to a local issuer."""

    issuer: str
    context: ssl.SSLContext | None = None  # other roots than the system's

    def check(self, url: str) -> SplitResult:
        """The URL's parts; ProviderError where it must not go."""
        parts, own = urlsplit(url), urlsplit(self.issuer)
        plain = parts.scheme == "http" and own.scheme == "http" and parts.netloc == own.netloc and _loopback(own)
        try:
            bad = parts.port == 0
        except ValueError:
            bad = True
        if bad or not (plain or parts.scheme == "https") or not parts.hostname or parts.username is not None:
            raise ProviderError(f"the provider names an address that is not asked: {url[:200]!r}")
        return parts

    async def address(self, parts: SplitResult) -> str:
        """The address to connect to; ProviderError when the name has none that may be used."""
        host = str(parts.hostname)
        try:
            loop = asyncio.get_running_loop()
            found = await loop.getaddrinfo(host, parts.port or 443, type=socket.SOCK_STREAM)
        except (OSError, UnicodeError) as error:
            raise ProviderError(f"{host} cannot be found: {error}") from error
        addresses = [str(item[4][0]) for item in found]
        inside = host != urlsplit(self.issuer).hostname
        if not addresses or (inside and not all(_public(address) for address in addresses)):
            raise ProviderError(f"{host} has an address inside a private network, and is not the issuer")
        return addresses[0]


async def fetch(
    policy: UrlPolicy,
    url: str,
    *,
    limit_bytes: int,
    form: bytes | None = None,
    authorization: str = "",
    timeout_s: float = TIMEOUT_S,
) -> tuple[int, bytes]:
    """The status and body of a GET, or of a POST of a form.

    Raises:
        ProviderError: no answer in time, a redirect, too many bytes, or a place that is not asked.
    """
    parts = policy.check(url)
    try:
        async with asyncio.timeout(timeout_s):
            return await _ask(policy, parts, limit_bytes=limit_bytes, form=form, authorization=authorization)
    except TimeoutError as error:
        raise ProviderError(f"{parts.netloc} gave no answer in {timeout_s:g} s") from error
    except (OSError, h11.RemoteProtocolError) as error:
        raise ProviderError(f"{parts.netloc} cannot be asked: {error}") from error


async def _ask(
    policy: UrlPolicy, parts: SplitResult, *, limit_bytes: int, form: bytes | None, authorization: str
) -> tuple[int, bytes]:
    secure = parts.scheme == "https"
    context = (policy.context or ssl.create_default_context()) if secure else None
    reader, writer = await asyncio.open_connection(
        await policy.address(parts),
        parts.port or (443 if secure else 80),
        ssl=context,
        server_hostname=parts.hostname if secure else None,
    )
    try:
        wire = h11.Connection(h11.CLIENT, max_incomplete_event_size=PIECE_BYTES)
        writer.write(_request(wire, parts, form, authorization))
        await writer.drain()
        return await _answer(wire, reader, limit_bytes)
    finally:
        writer.transport.abort()


def _request(wire: h11.Connection, parts: SplitResult, form: bytes | None, authorization: str) -> bytes:
    headers = [("Host", parts.netloc), ("Accept", "application/json"), ("Connection", "close")]
    headers += [("Authorization", authorization)] if authorization else []
    if form is not None:
        headers += [("Content-Type", "application/x-www-form-urlencoded"), ("Content-Length", str(len(form)))]
    target = f"{parts.path or '/'}{f'?{parts.query}' if parts.query else ''}"
    request = h11.Request(method="GET" if form is None else "POST", target=target, headers=headers)
    sent = wire.send(request) or b""
    sent += (wire.send(h11.Data(data=form)) or b"") if form is not None else b""
    return sent + (wire.send(h11.EndOfMessage()) or b"")


async def _answer(wire: h11.Connection, reader: asyncio.StreamReader, limit_bytes: int) -> tuple[int, bytes]:
    status, body = 0, bytearray()
    while True:
        event = wire.next_event()
        if event is h11.NEED_DATA:
            wire.receive_data(await reader.read(PIECE_BYTES))
        elif isinstance(event, h11.Response):
            status = event.status_code
            if 300 <= status < 400:
                raise ProviderError("the provider redirects; redirects are not followed")
        elif isinstance(event, h11.Data):
            body += event.data
            if len(body) > limit_bytes:
                raise ProviderError(f"the provider's answer is over {limit_bytes} bytes")
        elif isinstance(event, h11.EndOfMessage):
            return status, bytes(body)
        elif not isinstance(event, h11.InformationalResponse):
            raise ProviderError("the provider ended the connection early")


def _public(text: str) -> bool:
    address = ipaddress.ip_address(text.partition("%")[0])
    if isinstance(address, ipaddress.IPv6Address):
        inner = address.ipv4_mapped or address.sixtofour or (address.teredo[1] if address.teredo else None)
        nat64 = address in ipaddress.ip_network("64:ff9b::/96")
        if nat64:
            inner = ipaddress.IPv4Address(int(address) & 0xFFFFFFFF)
        if inner is not None:
            return inner.is_global and not inner.is_multicast
    return address.is_global and not address.is_multicast


def _loopback(parts: SplitResult) -> bool:
    try:
        return parts.hostname == "localhost" or ipaddress.ip_address(parts.hostname or "").is_loopback
    except ValueError:
        return False
