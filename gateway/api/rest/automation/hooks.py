"""Hooks: endpoints for others' webhooks, and what they received."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note
from gateway.api.models import rules as models
from gateway.api.models.common import Problem
from gateway.api.models.identity import Nothing
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rule_scope import seen_hook, sees_hook
from gateway.api.services import services_of
from gateway.api.views.rules import hook_view

__all__ = ["router"]

router = api_router("/api/v1/hooks", tags=["rules"])
NO_STORE = {"Cache-Control": "no-store"}


@router.get("", dependencies=[require_permission("rules.read")], responses={200: {"model": models.HookList}})
async def list_hooks(request: Request, window: Paged) -> Response:
    """Every hook in one's scope, by name."""
    principal = principal_of(request)
    found = [one for one in await services_of(request).rules.hooks.list() if sees_hook(principal, one)]
    return listing("hooks", found, hook_view, model=models.Hook, key=lambda one: one.name, window=window)


@router.post(
    "",
    status_code=201,
    dependencies=[require_permission("rules.write")],
    responses={201: {"model": models.HookMade}, **PROBLEMS},
    openapi_extra=body_document(models.HookRequest),
)
async def make_hook(request: Request) -> Response:
    """A hook, with its secret, which nobody is shown again."""
    body = await read_body(request, models.HookRequest)
    hook, secret = await services_of(request).rules.hooks.make(
        body.name, description=body.description, auth=body.auth, robot=body.robot, maker=principal_of(request)
    )
    note(request, detail=hook.name)
    return JsonResponse({**hook_view(hook), "secret": secret}, status_code=201, headers=NO_STORE)


@router.delete("/{hook}", status_code=204, dependencies=[require_permission("rules.write")], responses=PROBLEMS)
async def delete_hook(request: Request, hook: str) -> Response:
    """Take a hook away: nothing comes in by it any more."""
    found = await seen_hook(request, hook)
    await services_of(request).rules.hooks.remove(found.name)
    note(request, detail=found.name)
    return Response(status_code=204)


@router.post(
    "/{hook}/rotate",
    dependencies=[require_permission("rules.write")],
    responses={200: {"model": models.HookSecret}, **PROBLEMS},
    openapi_extra=body_document(Nothing),
)
async def rotate_hook(request: Request, hook: str) -> Response:
    """Another secret, at once; shown this once."""
    await read_body(request, Nothing)
    found = await seen_hook(request, hook)
    secret = await services_of(request).rules.hooks.rotate(found.name)
    note(request, detail=found.name)
    return JsonResponse({"secret": secret}, headers=NO_STORE)


@router.post(
    "/{hook}",
    status_code=202,
    dependencies=[require_permission("hooks.post")],
    responses={202: {"model": models.Received}, 401: {"model": Problem}, 429: {"model": Problem}, **PROBLEMS},
    openapi_extra=body_document(models.Anything),
)
async def receive_webhook(request: Request, hook: str) -> Response:
    """A webhook of somebody who has the hook's secret: any JSON, signed as Standard Webhooks has it, or with the secret
    in `Authorization: Bearer`. It is stored, judged by the rules and in the queue when this is answered.
    """
    headers = {name.lower(): value for name, value in request.headers.items()}
    done = await services_of(request).rules.hooks.receive(hook, headers, await request.body())
    return JsonResponse({"id": done.id, "duplicate": done.duplicate}, status_code=202)
