"""Bodies of requests, read when a route asks for them: after who asks is known and may ask. Pure ASGI.

A body has its limit, a deadline for each piece and one for the whole, and what all bodies together take of the memory
is bounded, as is the share of one address. What nobody asks for is never kept.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.api.authorization import PRINCIPAL_KEY, SAFE_METHODS
from gateway.api.aws.prefix import is_lambda
from gateway.api.middleware.guard import body_limit, drain, upload_limit
from gateway.api.middleware.rate import PAUSE_S, address_of
from gateway.api.webhook_path import is_webhook
from gateway.domain.principal import NOBODY, Principal
from gateway.errors import BodyTooLargeError, OverloadedError, RequestTimeoutError, TooManyRequestsError
from metaros.errors import MetarosError
from metaros.limits import LIMITS, Limits

__all__ = ["Bodies", "InFlight"]

BUSY_S = 1.0


@dataclass(slots=True)
class InFlight:
    """Bytes of bodies that have come and are not done with, of everybody and by address."""

    limits: Limits = LIMITS
    total: int = 0
    by_address: dict[str, int] = field(default_factory=dict)

    def add(self, address: str, size_bytes: int) -> None:
        """Count them in; an error says whose bound is met, and nothing is counted."""
        theirs = self.by_address.get(address, 0) + size_bytes
        if theirs > self.limits.bodies_address_bytes:
            raise TooManyRequestsError("too many bodies of this address are on their way", retry_after_s=BUSY_S)
        if self.total + size_bytes > self.limits.bodies_bytes:
            raise OverloadedError("too many bodies are on their way: try again")
        self.total += size_bytes
        self.by_address[address] = theirs

    def remove(self, address: str, size_bytes: int) -> None:
        """They are done with."""
        self.total -= size_bytes
        left = self.by_address.get(address, 0) - size_bytes
        if left > 0:
            self.by_address[address] = left
        else:
            self.by_address.pop(address, None)


class Bodies:
    """Gives a route its request's body in one piece, or raises why not."""

    def __init__(self, app: ASGIApp, *, limits: Limits = LIMITS) -> None:
        self._app = app
        self._limits = limits
        self.in_flight = InFlight(limits)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on, with a body that is read when it is asked for."""
        if scope["type"] != "http" or scope["method"] in SAFE_METHODS or is_lambda(scope["path"]):  # see aws/signed.py
            await self._app(scope, receive, send)
            return
        body = _Body(self, scope, receive, send)
        try:
            await self._app(scope, body.receive, body.send)
        finally:
            self.in_flight.remove(body.address, body.counted)

    def limit(self, scope: Scope) -> int:
        """How large a body may be; nobody's is small: it holds a password, a token or a certificate's request."""
        principal: Principal = scope.get(PRINCIPAL_KEY, NOBODY)
        most = body_limit(scope)
        return (
            most if principal.kind != "anonymous" or is_webhook(scope) else min(most, self._limits.anonymous_body_bytes)
        )

    @property
    def limits(self) -> Limits:
        """Its bounds."""
        return self._limits


class _Body:
    """The body of one request."""

    def __init__(self, middleware: Bodies, scope: Scope, receive: Receive, send: Send) -> None:
        self._middleware = middleware
        self._scope = scope
        self._receive = receive
        self._send = send
        self._read = False
        self._failed = False
        self.address = address_of(scope)
        self.counted = 0
        self.streamed = 0

    async def receive(self) -> Message:
        """The whole body first, then what else the connection says."""
        if upload_limit(self._scope):
            return await self._piece()
        if self._read:
            return await self._receive()
        self._read = True
        try:
            return await self._whole()
        except MetarosError:
            self._failed = True
            raise

    async def send(self, message: Message) -> None:
        """Pass on; where the rest of a body may still come, the connection ends with the answer."""
        if self._failed and message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", []), (b"connection", b"close")]}
        await self._send(message)

    async def _piece(self) -> Message:
        """One piece of a large file, which its route takes as it comes and never keeps in memory."""
        limit, limits = self._middleware.limit(self._scope), self._middleware.limits
        try:
            async with asyncio.timeout(limits.body_idle_s):
                message = await self._receive()
        except TimeoutError:
            self._failed = True
            raise RequestTimeoutError(f"the body did not come: {limits.body_idle_s:g} s for a piece") from None
        if message["type"] != "http.request":
            raise RequestTimeoutError("the connection ended within the body")
        self.streamed += len(message.get("body", b""))
        if self.streamed > limit or _said_bytes(self._scope) > limit:
            self._failed = True
            raise BodyTooLargeError(f"the body is over {limit} bytes")
        return message

    async def _whole(self) -> Message:
        limit, limits = self._middleware.limit(self._scope), self._middleware.limits
        if (said := _said_bytes(self._scope)) > limit:
            await self._let_go()
            raise BodyTooLargeError(f"the body has {said} bytes, at most {limit} may come")
        pieces: list[bytes] = []
        size = 0
        try:
            async with asyncio.timeout(limits.body_s):
                while True:
                    async with asyncio.timeout(limits.body_idle_s):
                        message = await self._receive()
                    if message["type"] != "http.request":  # an error of ours: others end as a traceback in the log
                        raise RequestTimeoutError("the connection ended within the body")
                    piece: bytes = message.get("body", b"")
                    size += len(piece)
                    if size > limit:
                        pieces.clear()
                        await self._let_go()
                        raise BodyTooLargeError(f"the body is over {limit} bytes")
                    self._middleware.in_flight.add(self.address, len(piece))
                    self.counted += len(piece)
                    if piece:
                        pieces.append(piece)
                    if not message.get("more_body", False):
                        return {"type": "http.request", "body": b"".join(pieces), "more_body": False}
        except TimeoutError:
            raise RequestTimeoutError(
                f"the body did not come: {limits.body_idle_s:g} s for a piece, {limits.body_s:g} s for all of it"
            ) from None

    async def _let_go(self) -> None:
        """Read on for a while, for who is known: a client that still sends would see its connection reset instead of
        the answer. Nobody's rest stays unread, and the answer takes its time.
        """
        principal: Principal = self._scope.get(PRINCIPAL_KEY, NOBODY)
        if principal.kind == "anonymous":
            await asyncio.sleep(PAUSE_S)
        else:
            await drain(self._receive)


def _said_bytes(scope: Scope) -> int:
    """What Content-Length says; Guard has seen that it is a number."""
    return max((int(value) for key, value in scope["headers"] if key.lower() == b"content-length"), default=0)
