"""Signing in and out, who one is, and one's own password."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import REFUSAL_KEY, principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.middleware.session_cookie import clear_session, set_session
from gateway.api.models import common, identity
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.services import services_of
from gateway.api.views.identity import account_view
from gateway.api.views.robots import rfc3339
from gateway.errors import CredentialsError
from gateway.identity.signin import SignedIn

__all__ = ["router"]

REFUSALS: dict[int | str, dict[str, Any]] = {
    **PROBLEMS,
    **{status: {"model": common.Problem} for status in (401, 403, 429)},
}

router = api_router("/api/v1/auth", tags=["accounts"])


@router.post(
    "/login",
    dependencies=[require_permission("sessions.open")],
    responses={200: {"model": identity.Account}, **REFUSALS},
    openapi_extra=body_document(identity.LoginRequest),
)
async def login(request: Request) -> Response:
    """Sign in by name and password; the answer sets the session's cookie."""
    body = await read_body(request, identity.LoginRequest)
    accounts = services_of(request).accounts
    return await _signed_in(request, await accounts.sign_in(body.name, body.password, address=_address(request)))


@router.post(
    "/link",
    dependencies=[require_permission("sessions.open")],
    responses={200: {"model": identity.Account}, **REFUSALS},
    openapi_extra=body_document(identity.TokenRequest),
)
async def follow_link(request: Request) -> Response:
    """Sign in by a one-time link; the answer sets the session's cookie."""
    body = await read_body(request, identity.TokenRequest)
    accounts = services_of(request).accounts
    return await _signed_in(request, await accounts.follow_link(body.token, address=_address(request)))


@router.post(
    "/links",
    status_code=201,
    dependencies=[require_permission("users.manage")],
    responses={201: {"model": identity.SignInLink}, **REFUSALS},
    openapi_extra=body_document(identity.LinkRequest),
)
async def make_link(request: Request) -> Response:
    """A link that signs a user in once, within 15 minutes; for the first administrator where no name is given."""
    body = await read_body(request, identity.LinkRequest)
    user, link = await services_of(request).accounts.make_link(body.name)
    here = f"{request.url.scheme}://{request.url.netloc}"
    document = {"user": user.name, "url": f"{here}/signin#{link.token}", "token": link.token}
    return JsonResponse({**document, "expires": rfc3339(link.expires_ns)}, status_code=201)


@router.post(
    "/logout",
    dependencies=[require_permission("sessions.close")],
    responses={200: {"model": common.Ok}, **REFUSALS},
    openapi_extra=body_document(identity.Nothing),
)
async def logout(request: Request) -> Response:
    """End the session that asks."""
    await read_body(request, identity.Nothing)
    await services_of(request).accounts.sign_out(principal_of(request))
    response = JsonResponse({"ok": True})
    clear_session(response, request)
    return response


@router.post(
    "/forget",
    dependencies=[require_permission("page.read")],
    responses={200: {"model": common.Ok}, **REFUSALS},
    openapi_extra=body_document(identity.Nothing),
)
async def forget(request: Request) -> Response:
    """Have the browser drop a session's cookie that is not good any more; a good one stays, which `logout` ends."""
    await read_body(request, identity.Nothing)
    response = JsonResponse({"ok": True})
    if isinstance(request.scope.get(REFUSAL_KEY), CredentialsError):
        clear_session(response, request)
    return response


@router.get(
    "/me",
    dependencies=[require_permission("self.read")],
    responses={200: {"model": identity.Account}, 401: {"model": common.Problem}},
)
async def get_me(request: Request) -> Response:
    """Who asks, and what they may do."""
    principal = principal_of(request)
    has_password = await services_of(request).accounts.has_password(principal)
    return JsonResponse(account_view(principal, has_password=has_password))


@router.post(
    "/password",
    dependencies=[require_permission("self.write")],
    responses={200: {"model": common.Ok}, **REFUSALS},
    openapi_extra=body_document(identity.PasswordRequest),
)
async def change_password(request: Request) -> Response:
    """Set one's own password; one's other sessions end."""
    body = await read_body(request, identity.PasswordRequest)
    accounts = services_of(request).accounts
    await accounts.change_own_password(principal_of(request), body.old, body.new, address=_address(request))
    return JsonResponse({"ok": True})


async def _signed_in(request: Request, done: SignedIn) -> Response:
    principal = await services_of(request).authenticator.by_session(done.session.token)
    if principal is None:  # removed in this very moment
        raise CredentialsError("the name or the password is wrong")
    note(request, actor=principal)
    response = JsonResponse(account_view(principal, has_password=bool(done.user.password)))
    set_session(response, request, done.session.token)
    return response


def _address(request: Request) -> str:
    return request.client.host if request.client is not None else ""
