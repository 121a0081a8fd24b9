"""Straight to the routes that are asked for more often than all others: FastAPI's way there costs more than they do.

A route here is declared like any other, with its permission, documents and handler, and is let in by the very same
check; what is left out is the search through all routes and what FastAPI prepares for handlers that ask for more than
the request. Pure ASGI, a middleware of the application: its errors and what fails without one are handled as ever.
"""

from __future__ import annotations

from collections.abc import Iterable

from fastapi.routing import APIRoute
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from gateway.api.authorization import authorize, permissions_of
from gateway.api.problem import problem
from gateway.identity.permissions import Permission
from metaros.errors import MetarosError

__all__ = ["FastPath"]


class FastPath:
    """Takes some GETs; all else goes on."""

    def __init__(self, app: ASGIApp, *, routes: Iterable[APIRoute]) -> None:
        """`routes` have paths without parameters, handlers of the request alone, and one permission each."""
        self._app = app
        self._routes: dict[str, tuple[APIRoute, Permission]] = {}
        for route in routes:
            (row,) = permissions_of(route)
            self._routes[route.path] = route, row

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, or pass on."""
        if scope["type"] != "http" or scope["method"] != "GET" or (found := self._routes.get(scope["path"])) is None:
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
