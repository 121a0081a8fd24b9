"""Every request and socket gets a number, is counted and timed, and what is logged meanwhile says whose it is.

Pure ASGI, outside of everything that may refuse. A route's label is its template in our own tables, and a method's one
that HTTP has, so that nobody can make up series.
"""

from __future__ import annotations

import logging
import re
import secrets
from collections.abc import Mapping
from typing import Any, Final

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.api.authorization import PRINCIPAL_KEY
from gateway.domain.principal import NOBODY, Principal
from gateway.ops.logs import log_context
from gateway.ops.meters import Meters
from metaros.clock import Clock

__all__ = ["REQUEST_ID", "Measured"]

log = logging.getLogger("gateway.access")

REQUEST_ID: Final = b"x-request-id"
_ID: Final = re.compile(r"[A-Za-z0-9._-]{1,64}")
_METHODS: Final = frozenset(("GET", "HEAD", "POST", "PUT", "PATCH", "DELETE", "OPTIONS"))


class Measured:
    """Counts on the way back."""

    def __init__(self, app: ASGIApp, meters: Meters, *, clock: Clock) -> None:
        self._app = app
        self._meters = meters
        self._clock = clock

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        watch = _Watch(scope, send, self._meters)
        began_s = self._clock.monotonic_s()
        with log_context(watch.facts):
            try:
                await self._app(scope, receive, watch.send)
            finally:
                watch.end(self._clock.monotonic_s() - began_s)


class _Watch:
    """One request or socket."""

    def __init__(self, scope: Scope, send: Send, meters: Meters) -> None:
        self._scope = scope
        self._send = send
        self._meters = meters
        self._status = 0
        self._open = False
        said = next((value.decode("latin-1") for key, value in scope["headers"] if key == REQUEST_ID), "")
        self._id = said if _ID.fullmatch(said) else secrets.token_hex(8)

    def facts(self) -> Mapping[str, str]:
        """What a line of the log tells of it; asked when one is written."""
        scope = self._scope
        who: Principal = scope.get(PRINCIPAL_KEY, NOBODY)
        robot = str(scope.get("path_params", {}).get("robot_id", ""))
        return {"request_id": self._id, "principal": f"{who.kind}:{who.name or who.id}", "robot": robot}

    async def send(self, message: Message) -> None:
        """Note what is answered; the answer carries the request's number."""
        kind = message["type"]
        if kind in ("http.response.start", "websocket.http.response.start"):
            self._status = message["status"]
            message = {**message, "headers": [*message.get("headers", ()), (REQUEST_ID, self._id.encode())]}
        elif kind == "websocket.accept":
            self._open = True
            self._meters.socket(self._route, opened=True)
        elif kind == "websocket.close" and not self._open:
            self._status = 403
        await self._send(message)

    def end(self, seconds: float) -> None:
        """It is over."""
        method = self._scope.get("method", "SOCKET")
        if self._open:
            self._meters.socket(self._route, opened=False)
        elif self._status:
            known = method if method in _METHODS or method == "SOCKET" else "other"
            self._meters.request(known, self._route, self._status, seconds=seconds)
        log.info("%s %s %d in %.1f ms", method, self._route, 101 if self._open else self._status, seconds * 1000)

    @property
    def _route(self) -> str:
        """The template of the route that took it; of what is refused before, or of none of ours, a word."""
        route: Any = self._scope.get("route")
        path = str(getattr(route, "path", ""))
        return path or ("page" if "endpoint" in self._scope else "other")
