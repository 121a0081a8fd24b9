"""A sign-in at an identity provider that is refused: a browser is led to the sign-in page, a program gets the problem.

Pure ASGI, outside everything that counts and logs refusals, so that these see the refusal itself. The address carries
a code of a fixed list (`refused=oidc_state`) and nothing that the provider or anybody else wrote.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import orjson
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from gateway.api.problem import PROBLEM_TYPE

__all__ = ["PLACES", "RefusedSignIn", "refused_because"]

PLACES = frozenset({"/api/v1/auth/oidc/start", "/api/v1/auth/oidc/callback"})
PAGE = "/signin"
_KEY = "sign_in_refused"


def refused_because(scope: Scope, why: str) -> None:
    """Say more than the problem's own code does."""
    scope.setdefault("state", {})[_KEY] = why


class RefusedSignIn:
    """Makes a redirect of a problem document at the two places where a browser is on its way."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass on; a browser's problem becomes the way to the sign-in page."""
        if scope["type"] != "http" or scope["path"] not in PLACES or not wants_page(scope["headers"]):
            await self._app(scope, receive, send)
            return
        scope.setdefault("state", {})
        refused = False

        async def led(message: Message) -> None:
            nonlocal refused
            if message["type"] == "http.response.start" and is_refusal(message):
                refused = True
            elif not refused:
                await send(message)
            elif not message.get("more_body", False):
                code = scope["state"].get(_KEY) or code_of(message)
                headers = {"cache-control": "no-store"}
                answer = RedirectResponse(f"{PAGE}?refused={code}", status_code=302, headers=headers)
                await answer(scope, receive, send)

        await self._app(scope, receive, led)


def wants_page(headers: Iterable[tuple[bytes, bytes]]) -> bool:
    """Whether a browser asks: on its way to a page it says that it takes HTML."""
    return any(name.lower() == b"accept" and b"text/html" in value.lower() for name, value in headers)


def is_refusal(start: Message) -> bool:
    """Whether an answer is a problem; that there is no provider (404) is none of a sign-in."""
    kinds = [value for name, value in start.get("headers", ()) if name.lower() == b"content-type"]
    return start["status"] >= 400 and start["status"] != 404 and kinds == [PROBLEM_TYPE.encode()]


def code_of(body: Message) -> str:
    """The problem's own code."""
    document: dict[str, Any] = orjson.loads(body["body"])
    return str(document["code"])
