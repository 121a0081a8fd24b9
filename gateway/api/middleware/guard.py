"""Checks before every request and socket: Host and Origin allow-list, body rules, security headers. Pure ASGI.

A web page somewhere can make a user's browser send requests to this machine. It cannot choose the Host header of a
name it does not own to be ours (DNS rebinding shows its own name), and it cannot hide its Origin. So: the Host must be
one of our names, an Origin must be the very host the request went to or an allowed one, and a mutation must carry a
body type that no HTML form can send.
"""

from __future__ import annotations

import asyncio
import contextlib
import re
from collections.abc import Iterable
from typing import Any

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.api.aws.prefix import is_lambda
from gateway.api.problem import PROBLEM_TYPE, problem_bytes
from gateway.api.viewer_endpoints import TOKEN_KEY
from gateway.api.webhook_path import is_webhook
from gateway.errors import BodyTooLargeError, HostError, MediaTypeError, OriginError, RequestError
from metaros.limits import LIMITS

__all__ = ["PROTOCOL_KEY", "UPLOADS", "Guard", "body_limit", "drain", "upload_limit"]

PROTOCOL_KEY = "metaros.protocol"  # where a socket's scope keeps uvicorn's protocol object, see ws/close.py
REFUSED = 4403
LOOPBACK_NAMES = ("localhost", "127.0.0.1", "[::1]")
MOST_DIGITS = 15  # of a Content-Length
AGENTS_ONLY = "/api/v1/link"  # no page of anybody's has business there, ours included
SAFE_METHODS = ("GET", "HEAD", "OPTIONS")
DRAINED_BYTES, DRAIN_S = 8 * 1024 * 1024, 10.0
UPLOADS = "/api/v1/updates/bundles"  # this and functions' code take zip files, see bodies.py
UPLOAD_TYPE = "application/zip"
BODY_LIMITS = {"application/json": LIMITS.json_bytes, "application/cdr": LIMITS.frame_bytes - 64 * 1024}

_FUNCTION = re.compile(r"/api/v1/functions/[^/]{1,64}")
_FUNCTION_CODE = re.compile(r"/api/v1/functions/[^/]{1,64}/code")
_HOST = re.compile(rb"(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9._-]+)(?::([0-9]{1,5}))?")
_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"referrer-policy", b"no-referrer"),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"x-permitted-cross-domain-policies", b"none"),
    (b"x-frame-options", b"DENY"),  # for browsers that do not know frame-ancestors
    # Nothing of a machine's own but the gamepad, which drives robots, the microphone, by which people talk through
    # them, and the whole screen for a camera's picture.
    (
        b"permissions-policy",
        b"accelerometer=(), camera=(), display-capture=(), geolocation=(), gyroscope=(), hid=(), magnetometer=(), "
        b"microphone=(self), midi=(), payment=(), serial=(), usb=(), gamepad=(self), fullscreen=(self)",
    ),
)
_NO_STORE = (b"cache-control", b"no-store")  # what the API says is of now, and for who asked


def _policy(host: str) -> bytes:
    """Our own page with its workers, camera pictures and sockets; nothing else, and no frame around it."""
    return (
        "default-src 'self'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' blob: data:; "
        f"media-src 'self' blob:; worker-src 'self' blob:; connect-src 'self' ws://{host} wss://{host}; "
        "object-src 'none'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ).encode()


class Guard:
    """Wraps the whole application; nothing inside sees a refused request."""

    def __init__(self, app: ASGIApp, *, hosts: Iterable[str] = (), origins: Iterable[str] = ()) -> None:
        self._app = app
        names = (f"[{name}]" if ":" in name and not name.startswith("[") else name for name in hosts)
        self._hosts = {name.lower() for name in (*LOOPBACK_NAMES, *names)}
        self._origins = {origin.lower().rstrip("/") for origin in origins}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Check, then pass on."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        try:
            host = self._check_source(scope)
            if scope["type"] == "http" and scope["method"] not in SAFE_METHODS:
                body_limit(scope)  # the body itself is read when it is known who asks, see bodies.py
        except RequestError as error:
            await _refuse(scope, send, error)
            return
        if scope["type"] == "websocket":
            scope.setdefault(PROTOCOL_KEY, getattr(send, "__self__", None))
            await self._app(scope, receive, send)
        else:
            await self._app(scope, receive, _with_headers(scope, send, _policy(host)))

    def _check_source(self, scope: Scope) -> str:
        """The request's host, when host and origin are ours."""
        hosts = _all(scope, b"host")
        match = _HOST.fullmatch(hosts[0]) if len(hosts) == 1 else None
        if match is None or match[1].decode().lower() not in self._hosts:
            shown = b", ".join(hosts)[:100].decode("latin-1")
            raise HostError(
                f"Host {shown!r} is not one of this gateway's names (start it with --allow-host to add one)"
            )
        host = hosts[0].decode().lower()
        origins = _all(scope, b"origin")
        allowed = {f"http://{host}", f"https://{host}", *self._origins} if scope["path"] != AGENTS_ONLY else set()
        # A page that has a token has been given it: nobody's browser sends one by itself, as it does a cookie.
        free = scope["type"] == "websocket" and TOKEN_KEY in scope
        if len(origins) > 1 or any(item.decode("latin-1").lower() not in allowed and not free for item in origins):
            shown = b", ".join(origins)[:100].decode("latin-1")
            raise OriginError(f"pages of {shown!r} may not use this gateway (start it with --allow-origin to let them)")
        return host


def _all(scope: Scope, name: bytes) -> list[bytes]:
    return [value for key, value in scope["headers"] if key.lower() == name]


def _has_body(scope: Scope) -> bool:
    lengths = _all(scope, b"content-length")
    return bool(_all(scope, b"transfer-encoding")) or any(length != b"0" for length in lengths)


def body_limit(scope: Scope) -> int:
    """How large the body of a mutation may be; MediaTypeError for what a form could send."""
    if is_lambda(scope["path"]):  # no session counts there: who signs a request has a secret that no page knows
        return _checked_length(scope, LIMITS.lambda_request_bytes)
    types = [value.split(b";")[0].strip().lower().decode("latin-1") for value in _all(scope, b"content-type")]
    # No form and no page of another origin can send DELETE without being asked first, so it needs no body to prove it.
    if not types and scope["method"] == "DELETE" and not _has_body(scope):
        return 0
    if types == [UPLOAD_TYPE] and (upload := upload_limit(scope)):
        return _checked_length(scope, upload)
    if types == ["application/json"] and scope["method"] == "PUT" and _FUNCTION.fullmatch(scope["path"]):
        return _checked_length(scope, LIMITS.function_deploy_bytes)
    if types == ["application/json"] and is_webhook(scope):
        return _checked_length(scope, LIMITS.hook_bytes)
    if len(types) != 1 or types[0] not in BODY_LIMITS:
        raise MediaTypeError("a request that changes something has Content-Type application/json or application/cdr")
    return _checked_length(scope, BODY_LIMITS[types[0]])


def upload_limit(scope: Scope) -> int:
    """How large a file may be that comes in pieces at this path; 0 where none does."""
    if scope["path"] == UPLOADS and scope["method"] == "POST":
        return LIMITS.bundle_bytes
    if scope["method"] == "PUT" and _FUNCTION_CODE.fullmatch(scope["path"]):
        return LIMITS.function_zip_bytes
    return 0


def _checked_length(scope: Scope, limit: int) -> int:
    for length in _all(scope, b"content-length"):
        if not length.isdigit() or len(length) > MOST_DIGITS:
            raise BodyTooLargeError(f"the body has {length[:20].decode('latin-1')} bytes, at most {limit} may come")
    return limit


async def drain(receive: Receive) -> None:
    """Read on for a while: a client that still sends would see its connection reset instead of the answer."""
    left = DRAINED_BYTES
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(DRAIN_S):
            while left > 0:
                message = await receive()
                if message["type"] != "http.request" or not message.get("more_body", False):
                    return
                left -= max(1, len(message.get("body", b"")))


def _with_headers(scope: Scope, send: Send, policy: bytes) -> Send:
    async def wrapped(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = [*message.get("headers", []), *_HEADERS, (b"content-security-policy", policy)]
            if scope["path"].startswith("/api/") and not any(key == b"cache-control" for key, _ in headers):
                headers.append(_NO_STORE)
            message = {**message, "headers": headers}
        await send(message)

    return wrapped


async def _refuse(scope: Scope, send: Send, error: RequestError) -> None:
    """A problem document; for a socket instead of its handshake, or close code 4403 where the server cannot."""
    if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": REFUSED, "reason": error.code})
        return
    prefix = "websocket.http.response" if scope["type"] == "websocket" else "http.response"
    row, body = problem_bytes(error)
    headers: list[Any] = [(b"content-type", PROBLEM_TYPE.encode()), (b"content-length", str(len(body)).encode())]
    if row.http == 413:
        headers.append((b"connection", b"close"))
    await send({"type": f"{prefix}.start", "status": row.http, "headers": [*headers, *_HEADERS, _NO_STORE]})
    await send({"type": f"{prefix}.body", "body": body})
