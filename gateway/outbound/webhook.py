"""A webhook: one POST, signed, within bounds of bytes, to nowhere else than its URL says; its caller bounds the time.

The signature is that of Standard Webhooks (https://www.standardwebhooks.com): HMAC-SHA256 over id, time and body.
"""

from __future__ import annotations

import asyncio
import base64
import hashlib
import hmac
import ssl
from dataclasses import dataclass, field
from urllib.parse import SplitResult, urlsplit

import h11

from gateway.outbound.reach import address_of

__all__ = ["CLOUD_EVENT", "JSON", "Webhook", "post", "signature", "signing_key"]

PIECE_BYTES = 16 * 1024
CLOUD_EVENT, JSON = "application/cloudevents+json", "application/json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Webhook:
    """Where to post. `secret` signs it, b"" does not."""

    url: str = field(repr=False)
    secret: bytes = field(default=b"", repr=False)
    token: str = field(default="", repr=False)  # for the Authorization header
    private: bool = False  # whether it may be in a private network, and plain http
    context: ssl.SSLContext | None = field(default=None, compare=False, repr=False)  # None: trusts as the system

    @property
    def target(self) -> str:
        """The URL without what may be secret in it: chats have their keys in paths."""
        parts = urlsplit(self.url)
        rest = parts.path.strip("/") or parts.query
        return f"{parts.scheme}://{parts.netloc}/{'…' if rest else ''}"


async def post(
    webhook: Webhook, body: bytes, *, message: str, at_s: int, content_type: str = CLOUD_EVENT, hint: str = ""
) -> int:
    """The status that the receiver answers; a redirect is not followed.

    `hint` says, behind the error of one that may not go into a private network, how that is allowed.

    Raises:
        OSError: it cannot be reached, or not there where webhooks may go.
        h11.RemoteProtocolError: what it answers is not HTTP.
    """
    parts = urlsplit(webhook.url)
    secure = parts.scheme == "https"
    port = parts.port or (443 if secure else 80)
    address = await address_of(str(parts.hostname), port, private=webhook.private, hint=hint)
    reader, writer = await asyncio.open_connection(
        address,
        port,
        ssl=(webhook.context or ssl.create_default_context()) if secure else None,
        server_hostname=parts.hostname if secure else None,
    )
    try:
        wire = h11.Connection(h11.CLIENT, max_incomplete_event_size=PIECE_BYTES)
        writer.write(_request(wire, parts, body, _headers(webhook, body, message, at_s, content_type)))
        await writer.drain()
        return await _status(wire, reader)
    finally:
        writer.transport.abort()


def signature(secret: bytes, body: bytes, *, message: str, at_s: int) -> str:
    """What proves that the message is ours: `v1,` and the MAC in base64."""
    mac = hmac.new(secret, f"{message}.{at_s}.".encode() + body, hashlib.sha256)
    return f"v1,{base64.b64encode(mac.digest()).decode()}"


def signing_key(secret: str) -> bytes:
    """The key of a secret: behind whsec_ it is base64, as Standard Webhooks has it. ValueError where it is none."""
    if not secret.startswith("whsec_"):
        return secret.encode()
    return base64.b64decode(secret.removeprefix("whsec_"), validate=True)


def _headers(webhook: Webhook, body: bytes, message: str, at_s: int, content_type: str) -> list[tuple[str, str]]:
    headers = [
        ("Content-Type", content_type),
        ("Content-Length", str(len(body))),
        ("Connection", "close"),
        ("User-Agent", "metaros"),
        ("webhook-id", message),
        ("webhook-timestamp", str(at_s)),
    ]
    if webhook.secret:
        headers.append(("webhook-signature", signature(webhook.secret, body, message=message, at_s=at_s)))
    if webhook.token:
        headers.append(("Authorization", f"Bearer {webhook.token}"))
    return headers


def _request(wire: h11.Connection, parts: SplitResult, body: bytes, headers: list[tuple[str, str]]) -> bytes:
    target = f"{parts.path or '/'}{f'?{parts.query}' if parts.query else ''}"
    said = [("Host", parts.netloc), *headers]
    sent = wire.send(h11.Request(method="POST", target=target, headers=said)) or b""
    sent += wire.send(h11.Data(data=body)) or b""
    return sent + (wire.send(h11.EndOfMessage()) or b"")


async def _status(wire: h11.Connection, reader: asyncio.StreamReader) -> int:
    """The status; what is in the answer's body is nobody's business."""
    while True:
        event = wire.next_event()
        if event is h11.NEED_DATA:
            data = await reader.read(PIECE_BYTES)
            if not data:
                raise ConnectionError("the receiver ended the connection early")
            wire.receive_data(data)
        elif isinstance(event, h11.Response):
            return event.status_code
