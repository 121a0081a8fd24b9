"""Signing in at an identity provider: the browser goes there and comes back."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import RedirectResponse, Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.middleware.refused_sign_in import refused_because
from gateway.api.middleware.session_cookie import set_session
from gateway.api.models import common, identity
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of
from gateway.errors import CredentialsError
from gateway.identity.errors import OidcRefusedError
from gateway.identity.oidc.client import BEGUN_S, OidcClient

__all__ = ["router"]

COOKIE = "metaros_oidc"
PATH = "/api/v1/auth/oidc"
Text = Annotated[str, Query(max_length=4096)]
REFUSALS: dict[int | str, dict[str, Any]] = {status: {"model": common.Problem} for status in (401, 404, 503)}

router = api_router(PATH, tags=["accounts"])


@router.get("", dependencies=[require_permission("page.read")], responses={200: {"model": identity.Provider}})
async def get_provider(request: Request) -> Response:
    """Whether people sign in elsewhere, and what to write on the button."""
    client = services_of(request).oidc
    found = (
        {"name": client.settings.name, "url": f"{PATH}/start"} if client is not None else {"name": None, "url": None}
    )
    return JsonResponse(found)


@router.get("/start", status_code=302, dependencies=[require_permission("sessions.open")], responses=REFUSALS)
async def start(request: Request) -> Response:
    """Send the browser to the provider."""
    begun = await _client(request).begin()
    answer = RedirectResponse(begun.url, status_code=302)
    # Lax: the provider's page sends the browser back, and with Strict the cookie would stay behind.
    answer.set_cookie(
        COOKIE,
        begun.cookie,
        max_age=round(BEGUN_S),
        path=PATH,
        secure=request.url.scheme == "https",
        httponly=True,
        samesite="lax",
    )
    return answer


@router.get("/callback", status_code=302, dependencies=[require_permission("sessions.open")], responses=REFUSALS)
async def callback(request: Request, code: Text = "", state: Text = "", error: Text = "") -> Response:
    """Where the provider sends the browser back: a session, and the dashboard; else the sign-in page, with a code.

    Programs, which take no HTML, get the problem instead (`gateway.api.middleware.refused_sign_in`).
    """
    client, services = _client(request), services_of(request)
    if error or not code or not state:
        refused_because(request.scope, "oidc_denied")
        raise OidcRefusedError("oidc_denied", f"the provider signed nobody in: {error[:100] or 'it sent no code'}")
    address = request.client.host if request.client is not None else ""
    try:
        person = await client.finish(code=code, state=state, cookie=request.cookies.get(COOKIE, ""))
        done = await services.accounts.sign_in_person(person, robots=client.settings.robots, address=address)
    except OidcRefusedError as refusal:
        refused_because(request.scope, refusal.why)
        raise
    principal = await services.authenticator.by_session(done.session.token)
    if principal is None:  # removed in this very moment
        raise CredentialsError("this user is gone")
    note(request, actor=principal, detail=f"by {client.settings.issuer}")
    answer = RedirectResponse("/", status_code=302)
    answer.delete_cookie(COOKIE, path=PATH, secure=request.url.scheme == "https", httponly=True, samesite="lax")
    set_session(answer, request, done.session.token)
    return answer


def _client(request: Request) -> OidcClient:
    found = services_of(request).oidc
    if found is None:
        raise HTTPException(404)
    return found
