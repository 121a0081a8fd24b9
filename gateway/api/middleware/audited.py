"""What the audit log holds of requests and sockets: everything that changes something, and everybody who is refused.

Pure ASGI, inside Authenticate. The answer to a request that may have changed something leaves when its row is
committed. Of bodies, queries and credentials nothing is kept; a route adds what is worth knowing by `note`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import orjson
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.api.authorization import PRINCIPAL_KEY, SAFE_METHODS
from gateway.api.problem import PROBLEM_TYPE, problem
from gateway.api.viewer_endpoints import needs_principal
from gateway.domain.principal import NOBODY, Principal, Role
from gateway.errors import StoreError
from gateway.identity.audit import AuditLog
from gateway.identity.permissions import Permission

__all__ = ["Audited", "note", "rights_detail"]

REFUSALS = (401, 403, 429)
TRY_AGAIN = 1013
NAMES_CHARS, SHOWN_CHARS = 64, 20  # of a part of a path: no name of ours is longer, and no secret so short


def note(connection: HTTPConnection, *, actor: Principal | None = None, detail: str = "") -> None:
    """Say more in the row of this request: who it turned out to be (a sign-in), or what changed. Never a secret."""
    kept: dict[str, Any] = connection.scope.setdefault("state", {}).setdefault("audit", {})
    if actor is not None:
        kept["actor"] = actor
    if detail:
        kept["detail"] = detail


def rights_detail(who: str, role: Role, robots: Sequence[str], *, disabled: bool = False) -> str:
    """What a user or a key may do from now on, as a row's detail."""
    return f"{who}: {role.word}, robots {' '.join(robots)}{', disabled' if disabled else ''}"


class Audited:
    """Writes the rows."""

    def __init__(self, app: ASGIApp, log: AuditLog) -> None:
        self._app = app
        self._log = log

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on; the row is written on the way back."""
        if scope["type"] not in ("http", "websocket") or not needs_principal(scope["path"]):
            await self._app(scope, receive, send)
            return
        scope.setdefault("state", {})
        watch = _Watch(self._log, scope, send)
        if watch.changes:
            try:
                self._log.check_room()
            except StoreError as error:
                await problem(error)(scope, receive, send)
                return
        try:
            await self._app(scope, receive, watch.send)
        finally:
            watch.end()


class _Watch:
    """One request or socket on its way back."""

    def __init__(self, log: AuditLog, scope: Scope, send: Send) -> None:
        self._log = log
        self._scope = scope
        self._send = send
        self._held: Message | None = None  # the start of an answer, until its first piece tells the code
        self._done = False
        self.changes = scope["type"] == "http" and scope["method"] not in SAFE_METHODS

    async def send(self, message: Message) -> None:
        """Pass an answer's pieces on, after its row."""
        kind = str(message["type"])
        if self._done:
            await self._send(message)
        elif kind.endswith("response.start") and (self._changed or message["status"] in REFUSALS):
            self._held = message
        elif kind.endswith("response.body") and self._held is not None:
            held, self._held, self._done = self._held, None, True
            await self._write(held["status"], _code(held, message))
            await self._send(held)
            await self._send(message)
        else:
            await self._opening(kind)
            await self._send(message)

    def end(self) -> None:
        """The application is through: what changed something without an answer that anybody saw gets its row, too."""
        if not self._done and self.changes and self._granted is not None and self._granted.mutates:
            self._log.add(**self._facts(0, "no_answer"))

    async def _opening(self, kind: str) -> None:
        """A socket that opens, or is refused by a server that knows no other way than closing it."""
        if kind == "websocket.accept":
            self._done = True
            if self._granted is not None and self._granted.mutates:
                await self._log.record(**self._facts(101, ""))
        elif kind == "websocket.close":
            self._done = True
            self._log.refuse(**self._facts(403, "refused"))

    async def _write(self, status: int, code: str) -> None:
        row = self._granted
        if status in REFUSALS or (row is not None and row.who == "anyone" and status >= 400):
            self._log.refuse(**self._facts(status, code))
        elif self._changed and row is not None and row.mutates:
            await self._log.record(**self._facts(status, code))

    @property
    def _changed(self) -> bool:
        """Whether it may have changed something: a GET has where somebody came back from where they sign in."""
        return self.changes or "actor" in self._scope["state"].get("audit", {})

    @property
    def _granted(self) -> Permission | None:
        found: Permission | None = self._scope["state"].get("permission")
        return found

    def _facts(self, status: int, code: str) -> dict[str, Any]:
        scope, state = self._scope, self._scope["state"]
        said: dict[str, Any] = state.get("audit", {})
        asked: Permission | None = state.get("asked")
        actor: Principal = said.get("actor") or scope.get(PRINCIPAL_KEY, NOBODY)
        client = scope.get("client")
        return {
            "kind": actor.kind,
            "actor": actor.id,
            "name": actor.name,
            "role": actor.role.word,
            "address": client[0] if client else "",
            "action": asked.name if asked is not None else "",
            "method": scope.get("method", "SOCKET"),
            "target": _target(scope["path"]),
            "status": status,
            "code": code,
            "detail": said.get("detail", ""),
        }


def _target(path: str) -> str:
    """The path, in which nothing is as long as a key or a token: somebody has pasted a whole one for its id."""
    parts = path.split("/")
    return "/".join(part if len(part) <= NAMES_CHARS else f"{part[:SHOWN_CHARS]}…" for part in parts)


def _code(start: Message, body: Message) -> str:
    """The code of a problem document; "" for another answer."""
    kinds = [value for key, value in start.get("headers", ()) if key.lower() == b"content-type"]
    if kinds != [PROBLEM_TYPE.encode()]:
        return ""
    try:
        return str(orjson.loads(body.get("body", b""))["code"])
    except (ValueError, KeyError, TypeError):
        return ""
