"""Straight to the routes that are asked for more often than all others: FastAPI's way there costs more than they do.

A route here is declared like any other, with its permission, documents and handler, and is let in by the very same
check; what is left out is the search through all routes and what FastAPI prepares for handlers that ask for more than
the request. Pure ASGI, a middleware of the application: its errors and what fails without one are handled as ever.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from fastapi.routing import APIRoute
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from gateway.api.authorization import authorize, permissions_of
from gateway.api.problem import problem
from gateway.identity.permissions import Permission
from metaros.errors import MetarosError

__all__ = ["FastPath"]


class FastPath:
    """Takes some requests; all else goes on."""

    def __init__(
        self, app: ASGIApp, *, routes: Iterable[APIRoute], trees: Mapping[str, APIRoute] | None = None
    ) -> None:
        """`routes` are GETs whose paths have no parameters; `trees` are by the path below which they take everything
        that is a POST. Handlers are of the request alone, with one permission each.
        """
        self._app = app
        self._routes = {route.path: (route, _permission(route)) for route in routes}
        self._trees = tuple((path, route, _permission(route)) for path, route in (trees or {}).items())

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass on."""
        if scope["type"] != "http" or (found := self._find(scope["method"], scope["path"])) is None:
            await self._app(scope, receive, send)
            return
        route, row = found
        scope.update(route=route, endpoint=route.endpoint, path_params={})
        request = Request(scope, receive, send)
        try:
            authorize(request, row)
            response = await route.endpoint(request)
        except MetarosError as error:
            response = problem(error)
        await response(scope, receive, send)

    def _find(self, method: str, path: str) -> tuple[APIRoute, Permission] | None:
        if method == "GET":
            return self._routes.get(path)
        if method == "POST":
            return next(((route, row) for below, route, row in self._trees if path.startswith(below)), None)
        return None


def _permission(route: APIRoute) -> Permission:
    (row,) = permissions_of(route)
    return row
