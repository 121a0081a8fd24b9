"""API keys: one's own, and for admins everybody's."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note, rights_detail
from gateway.api.models import common, identity
from gateway.api.problem import JsonResponse
from gateway.api.rest.accounts.auth import REFUSALS
from gateway.api.rest.bodies import body_document, read_body
from gateway.api.services import services_of
from gateway.api.views.identity import key_view, new_key_view
from gateway.domain.principal import Role
from gateway.identity.keys import KeyRequest
from gateway.identity.users import checked_robots

__all__ = ["router"]

router = api_router("/api/v1/keys", tags=["accounts"])


@router.get(
    "",
    dependencies=[require_permission("keys.own")],
    responses={200: {"model": identity.ApiKeyList}, 401: {"model": common.Problem}},
)
async def list_keys(request: Request, window: Paged) -> Response:
    """One's own keys, or for an admin everybody's, the newest first. A key sees none but as an admin."""
    found = await services_of(request).accounts.list_keys(principal_of(request))
    return listing(
        "keys",
        found,
        lambda pair: key_view(*pair),
        model=identity.ApiKey,
        key=lambda pair: pair[0].id,
        window=window,
    )


@router.post(
    "",
    status_code=201,
    dependencies=[require_permission("keys.own")],
    responses={201: {"model": identity.NewApiKey}, **REFUSALS},
    openapi_extra=body_document(identity.ApiKeyRequest),
)
async def create_key(request: Request) -> Response:
    """Make a key that reaches no further than who asks. Its secret is in this answer and nowhere else."""
    body = await read_body(request, identity.ApiKeyRequest)
    principal = principal_of(request)
    robots = checked_robots(body.robots)
    wanted = KeyRequest(body.name, Role.of(body.role), robots, frozenset(body.scopes), body.expires_s)
    made = await services_of(request).accounts.create_key(principal, wanted)
    note(request, detail=rights_detail(f"key {made.key.id} {made.key.name}", made.key.role, made.key.robots))
    owner = principal.name if principal.kind == "user" else ""
    return JsonResponse(new_key_view(made, owner), status_code=201)


@router.delete(
    "/{key_id}",
    dependencies=[require_permission("keys.own")],
    responses={200: {"model": common.Ok}, **REFUSALS},
)
async def revoke_key(request: Request, key_id: str) -> Response:
    """Revoke a key for ever."""
    await services_of(request).accounts.revoke_key(principal_of(request), key_id)
    return JsonResponse({"ok": True})
