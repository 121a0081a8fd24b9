"""How often somebody may ask: one table of token buckets, and the part of the application that keeps to it. Pure ASGI.

Whoever is known is counted by who they are, and nobody by their address (an IPv6 address by its /64 network). Failed
sign-ins, credentials that are not good and enrolments count by address whoever asks; what changes a robot counts for
that robot, whoever asks. The defaults are several times what the dashboard, the command line and a busy script need.
"""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, replace
from typing import Literal

from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.api.authorization import PRINCIPAL_KEY, RATES_KEY
from gateway.api.middleware.fair_queue import FairQueue
from gateway.api.middleware.guard import AGENTS_ONLY, PROTOCOL_KEY
from gateway.api.problem import problem
from gateway.domain.buckets import TokenBuckets
from gateway.domain.principal import NOBODY, Principal, Role
from gateway.errors import TooManyRequestsError
from gateway.identity.lockout import address_group
from gateway.identity.permissions import Permission
from metaros.clock import Clock
from metaros.limits import LIMITS

__all__ = ["RATES", "Rate", "RateLimited", "Rates", "address_of"]

PAUSE_S = 0.5  # that a refusal takes, which slows down who floods: a connection asks one thing at a time
POLICY = 1008  # with which http_server.py ends a socket that sends too many frames
TOO_OFTEN = 4429  # the close code of a socket whose client says too much
SIGN_INS = ("/api/v1/auth/login", "/api/v1/auth/link")
FLOODED, FLOODED_KNOWN = 150.0, 10.0  # sockets that one counts for that had to be ended
PROBES = ("/healthz", "/readyz")
MIB = 1024 * 1024

Name = Literal[
    "requests", "anonymous", "strangers", "refused", "sign_in", "enrol", "robot", "sockets", "messages", "message_bytes"
]


@dataclass(frozen=True, slots=True)
class Rate:
    """One row: `per_s` on average (0: no limit), `burst` at once."""

    name: Name
    per_s: float
    burst: float
    of: str
    meaning: str


RATES: tuple[Rate, ...] = (
    Rate("requests", 500.0, 2500.0, "a user or key", "requests"),
    Rate("anonymous", 200.0, 1000.0, "an address", "requests of who has not signed in, files of the dashboard too"),
    Rate("strangers", 200.0, 100.0, "everybody", "requests of who may do nothing yet; more take turns by address"),
    Rate("refused", 20.0, 200.0, "an address", "keys and sessions that were not good"),
    Rate("sign_in", 5 / 60, 10.0, "an address", "sign-ins that failed, beside the lock-out by name"),
    Rate("enrol", 5.0, 100.0, "an address", "requests for a robot's certificate, failed ones"),
    Rate("robot", 100.0, 500.0, "a robot", "requests that change something on it, of everybody together"),
    Rate("sockets", 5.0, 100.0, "a user, key or address", "sockets opened"),
    Rate("messages", 200.0, 1000.0, "a socket", "messages of a client"),
    Rate("message_bytes", 1.0 * MIB, 4.0 * MIB, "a socket", "bytes of a client's messages"),
)
_COUNTED = {"sessions.open": "sign_in", "agent.enrol": "enrol"}  # permissions whose failures count by address
_FAILED_FROM = 400


class Rates:
    """The buckets of one gateway."""

    def __init__(self, *, clock: Clock, table: tuple[Rate, ...] = RATES, **per_s: float | None) -> None:
        """`per_s` has other rates by name, with bursts in proportion; 0 turns one off."""
        rows = [_scaled(row, per_s.get(row.name)) for row in table]
        self._clock = clock
        self._buckets: dict[str, TokenBuckets] = {
            row.name: TokenBuckets(per_s=row.per_s, burst=row.burst) for row in rows
        }
        self.fair_queue = FairQueue(
            lambda: not self._buckets["strangers"].take("", self._clock.monotonic_s()),
            per_s=next((row.per_s for row in rows if row.name == "strangers"), 0.0),
            most_each=LIMITS.strangers_waiting_each,
            most=LIMITS.strangers_waiting,
        )
        self.open: dict[str, int] = {}  # sockets, by who has them

    def take(self, name: str, key: object, amount: float = 1.0) -> None:
        """Take it; TooManyRequestsError says when to come back."""
        wait_s = self._buckets[name].take(key, self._clock.monotonic_s(), amount)
        if wait_s:
            raise TooManyRequestsError("too many requests: wait", retry_after_s=wait_s)

    def check(self, name: str, key: object) -> None:
        """TooManyRequestsError when `take` would raise it; takes nothing."""
        wait_s = self._buckets[name].wait_s(key, self._clock.monotonic_s())
        if wait_s:
            raise TooManyRequestsError("too many requests: wait", retry_after_s=wait_s)

    def count(self, name: str, key: object, amount: float = 1.0) -> None:
        """Take it whether it is there or not: the next ones wait the longer."""
        self._buckets[name].drop(key, self._clock.monotonic_s(), amount)

    def give(self, name: str, key: object) -> None:
        """It was taken for nothing."""
        self._buckets[name].give(key, self._clock.monotonic_s())

    def admit(self, connection: HTTPConnection, row: Permission) -> None:
        """What a permission costs beside the request: failures by address, changes by robot."""
        name, robot_id = _COUNTED.get(row.name), connection.path_params.get("robot_id")
        try:
            if name is not None:
                self.take(name, address_of(connection.scope))
                connection.state.taken = name
            if row.robots and row.mutates and robot_id is not None:
                self.take("robot", robot_id)
        except TooManyRequestsError:
            connection.state.refused = True
            raise


class RateLimited:
    """Refuses who asks too often, and ends sockets whose clients say too much."""

    def __init__(self, app: ASGIApp, rates: Rates) -> None:
        self._app = app
        self._rates = rates
        self._refused = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Count, then pass on."""
        if scope["type"] not in ("http", "websocket") or scope["path"] in PROBES:
            await self._app(scope, receive, send)
            return
        scope[RATES_KEY] = self._rates
        try:
            key = self._count(scope)
            principal: Principal = scope.get(PRINCIPAL_KEY, NOBODY)
            if principal.role is Role.NONE and principal.kind != "robot":
                await self._rates.fair_queue.wait(address_of(scope))
        except TooManyRequestsError as error:
            await asyncio.sleep(self._pause())
            await refuse(scope, receive, send, error)
            return
        if scope["type"] == "http":
            await self._app(scope, receive, self._refunding(scope, send))
        elif scope["path"] == AGENTS_ONLY:
            await self._app(scope, receive, send)  # a robot's link has its own, see gateway/ingest
        else:
            await self._socket(key, scope, receive, send)

    def _pause(self) -> float:
        """Longer for one and shorter for the next, so that those refused together do not come back together."""
        self._refused += 1
        return PAUSE_S * (1.0 + self._refused % 64 / 16)

    def _count(self, scope: Scope) -> str:
        """Take one request; who was counted."""
        principal: Principal = scope.get(PRINCIPAL_KEY, NOBODY)
        known = principal.kind != "anonymous"
        key = f"{principal.kind} {principal.id}" if known else address_of(scope)
        if known:
            self._rates.take("requests", key)
        else:
            self._rates.take("anonymous", key)
        if scope["path"] in SIGN_INS:
            self._rates.check("sign_in", address_of(scope))  # early: a flood of them is to cost little
        if scope["type"] == "websocket" and scope["path"] != AGENTS_ONLY:
            self._rates.take("sockets", key)
            if self._rates.open.get(key, 0) >= LIMITS.sockets_open:
                raise TooManyRequestsError("too many sockets are open: close some", retry_after_s=1.0)
        return key

    def _refunding(self, scope: Scope, send: Send) -> Send:
        """What counts by its failures is given back to who did not fail."""

        async def wrapped(message: Message) -> None:
            if message["type"] == "http.response.start":
                state = scope.get("state", {})
                if "taken" in state and message["status"] < _FAILED_FROM:
                    self._rates.give(state["taken"], address_of(scope))
                elif "refused" in state or ("taken" in state and message["status"] == 429):
                    await asyncio.sleep(self._pause())
            await send(message)

        return wrapped

    async def _socket(self, key: str, scope: Scope, receive: Receive, send: Send) -> None:
        rates = self._rates
        me = object()  # a bucket of its own
        cost = FLOODED if scope.get(PRINCIPAL_KEY, NOBODY).kind == "anonymous" else FLOODED_KNOWN

        async def counted() -> Message:
            message = await receive()
            if message["type"] != "websocket.receive":
                if message.get("code") == POLICY:
                    rates.count("sockets", key, cost)
                return message
            try:
                rates.take("messages", me)
                rates.take("message_bytes", me, len(message.get("text") or message.get("bytes") or ""))
            except TooManyRequestsError:
                rates.count("sockets", key, cost)
                words = getattr(scope.get(PROTOCOL_KEY), "close_notice", "")
                if words:
                    await send({"type": "websocket.send", "text": words})
                await send({"type": "websocket.close", "code": TOO_OFTEN, "reason": TooManyRequestsError.code})
                return {"type": "websocket.disconnect", "code": TOO_OFTEN}
            return message

        rates.open[key] = rates.open.get(key, 0) + 1
        try:
            await self._app(scope, counted, send)
        finally:
            rates.open[key] -= 1
            if not rates.open[key]:
                del rates.open[key]


def address_of(scope: Scope) -> str:
    """Whom an address counts for; the address itself was settled by `Proxies`."""
    client = scope.get("client")
    return address_group(client[0]) if client else ""


async def refuse(scope: Scope, receive: Receive, send: Send, error: TooManyRequestsError) -> None:
    """The problem, with Retry-After; for a socket instead of its handshake."""
    if scope["type"] == "websocket" and "websocket.http.response" not in scope.get("extensions", {}):
        await send({"type": "websocket.close", "code": TOO_OFTEN, "reason": error.code})
        return
    await problem(error)(scope, receive, send)


def _scaled(row: Rate, per_s: float | None) -> Rate:
    if per_s is None:
        return row
    return replace(row, per_s=per_s, burst=max(1.0, row.burst / row.per_s * per_s))
