"""The session's cookie: no script reads it, no other page's mutation carries it, and under https only https does."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.middleware.authenticate import COOKIE
from metaros.limits import LIMITS

__all__ = ["clear_session", "set_session"]


def set_session(response: Response, request: Request, token: str) -> None:
    """Sign the browser in."""
    response.set_cookie(
        COOKIE,
        token,
        max_age=round(LIMITS.session_s),
        path="/",
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="lax",
    )


def clear_session(response: Response, request: Request) -> None:
    """Sign the browser out."""
    response.delete_cookie(COOKIE, path="/", secure=request.url.scheme == "https", httponly=True, samesite="lax")
