"""Users: who they are, what they may do, which robots they see."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note, rights_detail
from gateway.api.middleware.conditional import check_match
from gateway.api.models import common, identity
from gateway.api.problem import JsonResponse
from gateway.api.rest.accounts.auth import REFUSALS
from gateway.api.rest.bodies import body_document, read_body
from gateway.api.rest.once import once_of
from gateway.api.services import services_of
from gateway.api.views.identity import user_view
from gateway.domain.principal import Role

__all__ = ["router"]

router = api_router("/api/v1/users", tags=["accounts"])


@router.get(
    "",
    dependencies=[require_permission("users.manage")],
    responses={200: {"model": identity.UserList}, 401: {"model": common.Problem}},
)
async def list_users(request: Request, window: Paged) -> Response:
    """Everybody, by name."""
    found = await services_of(request).accounts.list_users()
    return listing("users", found, user_view, model=identity.User, key=lambda user: user.name, window=window)


@router.post(
    "",
    status_code=201,
    dependencies=[require_permission("users.manage")],
    responses={201: {"model": identity.User}, **REFUSALS},
    openapi_extra=body_document(identity.UserRequest),
)
async def create_user(request: Request) -> Response:
    """Make a user; without a password they sign in by a link. With an Idempotency-Key the same request makes one."""
    body = await read_body(request, identity.UserRequest)
    asked = {"user": body.name, "role": body.role, "robots": body.robots, "password": bool(body.password)}
    made = await services_of(request).accounts.create_user(
        body.name,
        role=Role.of(body.role),
        robots=tuple(body.robots),
        password=body.password,
        once=once_of(request, asked),
    )
    note(request, detail=rights_detail(made.name, made.role, made.robots))
    return JsonResponse(user_view(made), status_code=201)


@router.get(
    "/{name}",
    dependencies=[require_permission("users.manage")],
    responses={200: {"model": identity.User}, **REFUSALS},
)
async def get_user(request: Request, name: str) -> Response:
    """One user. The ETag is for If-Match."""
    return JsonResponse(user_view(await services_of(request).accounts.get_user(name)))


@router.patch(
    "/{name}",
    dependencies=[require_permission("users.manage")],
    responses={200: {"model": identity.User}, **REFUSALS, 412: {"model": common.Problem}},
    openapi_extra=body_document(identity.UserChange),
)
async def change_user(request: Request, name: str) -> Response:
    """Change role, robots or password, or lock a user out. It counts at once, for open sockets within seconds."""
    body = await read_body(request, identity.UserChange)
    changed = await services_of(request).accounts.change_user(
        name,
        role=Role.of(body.role) if body.role is not None else None,
        robots=tuple(body.robots) if body.robots is not None else None,
        disabled=body.disabled,
        password=body.password,
        check=lambda user: check_match(request, user_view(user)),
    )
    detail = rights_detail(changed.name, changed.role, changed.robots, disabled=changed.disabled)
    note(request, detail=detail + (", password set" if body.password is not None else ""))
    return JsonResponse(user_view(changed))


@router.delete(
    "/{name}",
    dependencies=[require_permission("users.manage")],
    responses={200: {"model": common.Ok}, **REFUSALS, 412: {"model": common.Problem}},
)
async def delete_user(request: Request, name: str) -> Response:
    """Delete a user with their sessions and keys."""
    await services_of(request).accounts.delete_user(name, check=lambda user: check_match(request, user_view(user)))
    return JsonResponse({"ok": True})
