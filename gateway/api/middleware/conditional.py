"""ETags for every JSON answer to a GET: who has it already is told 304, without the body. Pure ASGI.

An answer that has an ETag of its own keeps it; streams and files are let through. The tag is of the very bytes.
"""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import blake2b
from typing import Any

from starlette.datastructures import MutableHeaders
from starlette.requests import Request
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.api.problem import JsonResponse
from gateway.domain.errors import ChangedError

__all__ = ["Conditional", "check_match", "entity_tag", "matches"]

PREFIX = "/api/v1/"
KEPT = ("etag", "cache-control", "vary", "content-location", "expires")  # of a 304, RFC 9110 section 15.4.5


def entity_tag(body: bytes) -> str:
    """The strong validator of some bytes, quotes included."""
    return f'"{blake2b(body, digest_size=12).hexdigest()}"'


def matches(condition: str, tag: str) -> bool:
    """Whether If-None-Match names a tag; weak comparison, as RFC 9110 asks for there."""
    wanted = tag.removeprefix("W/")
    return any(part.strip().removeprefix("W/") in (wanted, "*") for part in condition.split(","))


def check_match(request: Request, view: Mapping[str, Any]) -> None:
    """ChangedError when If-Match names another state than what a GET of this would answer now."""
    said = request.headers.get("if-match", "").strip()
    if said in ("", "*"):
        return
    tag = entity_tag(bytes(JsonResponse(view).body))
    if tag not in (part.strip() for part in said.split(",")):
        raise ChangedError("it is not as If-Match names it any more: read it again")


class Conditional:
    """Around the routes."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, with a tag; or say that nothing has changed."""
        if scope["type"] == "http" and scope["method"] == "GET" and scope["path"].startswith(PREFIX):
            send = _Answer(scope, send)
        await self._app(scope, receive, send)


class _Answer:
    """One answer on its way: its start waits until it is known whether the body is all there."""

    def __init__(self, scope: Scope, send: Send) -> None:
        self._send = send
        named = [value.decode("latin-1") for key, value in scope["headers"] if key == b"if-none-match"]
        self._condition = ",".join(named)
        self._start: Message | None = None

    async def __call__(self, message: Message) -> None:
        """What the route sends."""
        if message["type"] == "http.response.start" and _taggable(message):
            self._start = message
            return
        start, self._start = self._start, None
        if start is None:
            await self._send(message)
        elif message["type"] != "http.response.body" or message.get("more_body", False):
            await self._send(start)
            await self._send(message)
        else:
            await self._whole(start, message)

    async def _whole(self, start: Message, message: Message) -> None:
        headers = MutableHeaders(raw=start["headers"])
        tag = headers.get("etag")
        if tag is None:
            tag = headers["etag"] = entity_tag(message.get("body", b""))
        if self._condition and matches(self._condition, tag):
            kept = [(key, value) for key, value in start["headers"] if key.decode("latin-1") in KEPT]
            start, message = {**start, "status": 304, "headers": kept}, {**message, "body": b""}
        await self._send(start)
        await self._send(message)


def _taggable(message: Message) -> bool:
    if message["status"] != 200:
        return False
    return any(key == b"content-type" and value.startswith(b"application/json") for key, value in message["headers"])
