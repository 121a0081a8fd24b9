"""The endpoints of Foxglove and rosbridge: their paths, their own ports, and the token in their URL.

Foxglove and rosbridge clients know a port and nothing of paths, and no browser lets a page set a header of a socket.
So each protocol has a port on which `/` is what `/foxglove` or `/rosbridge` is on the main one, and these sockets and
the stream take a credential as `?token=`. It is lifted out of the URL before anything else sees it: no log has it.
"""

from __future__ import annotations

from collections.abc import Mapping
from urllib.parse import parse_qsl, urlencode

from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Receive, Scope, Send

__all__ = [
    "FOXGLOVE",
    "ROSBRIDGE",
    "TOKEN_KEY",
    "ProtocolPorts",
    "QueryToken",
    "accepts_query_token",
    "needs_principal",
]

FOXGLOVE, ROSBRIDGE = "/foxglove", "/rosbridge"
STREAM = "/api/v1/stream"
TOKEN_KEY = "metaros.token"  # of a scope: the values of `token` that its URL had
_HERE = {
    FOXGLOVE: "This port speaks the Foxglove WebSocket protocol: open ws://HOST:PORT in Foxglove or Lichtblick.\n",
    ROSBRIDGE: "This port speaks rosbridge v2: give ws://HOST:PORT to roslib or roslibpy.\n",
}


def needs_principal(path: str) -> bool:
    """Whether requests of a path are authenticated: the API's own, Lambda's, and viewers' sockets."""
    return path.startswith(("/api/", "/lambda/")) or path in ("/metrics", "/lambda") or _is_viewer(path)


def accepts_query_token(path: str) -> bool:
    """Whether a credential in the URL is taken there."""
    return path == STREAM or _is_viewer(path)


def _is_viewer(path: str) -> bool:
    return path.startswith((f"{FOXGLOVE}/", f"{ROSBRIDGE}/")) or path in (FOXGLOVE, ROSBRIDGE)


class ProtocolPorts:
    """The application as it looks from the ports of the protocols; other ports are as they were. Pure ASGI."""

    def __init__(self, app: ASGIApp, paths: Mapping[int, str]) -> None:
        """`paths` says which path each port serves: 8765 -> "/foxglove"."""
        self._app = app
        self._paths = dict(paths)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Put the port's path before the one that was asked for."""
        prefix = self._prefix(scope)
        if prefix is not None and scope["type"] == "http":
            await PlainTextResponse(_HERE[prefix], 426, {"upgrade": "websocket"})(scope, receive, send)
            return
        if prefix is not None:
            path = scope["path"].rstrip("/")
            scope["path"] = path if path.startswith(prefix) else prefix + path
            scope["raw_path"] = scope["path"].encode()
        await self._app(scope, receive, send)

    def _prefix(self, scope: Scope) -> str | None:
        server = scope.get("server")
        return self._paths.get(server[1]) if scope["type"] in ("http", "websocket") and server else None


class QueryToken:
    """Moves `token` out of a socket's query string into the scope. Pure ASGI, outside of everything that logs."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """The very scope of the server is changed: it logs the query string, too."""
        if (
            scope["type"] in ("http", "websocket")
            and b"token" in scope["query_string"]
            and accepts_query_token(scope["path"])
        ):
            pairs = parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)
            if tokens := [value for name, value in pairs if name == "token"]:  # none: a name like it, and no credential
                scope[TOKEN_KEY] = tokens
            scope["query_string"] = urlencode([pair for pair in pairs if pair[0] != "token"]).encode()
        await self._app(scope, receive, send)
