"""Where notices of alerts go, as the file of `--notify` says, and whether they come."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api import models_identity, models_watch
from gateway.api.allow import allow, principal_of, require_all
from gateway.api.audited import note
from gateway.api.later_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.services import services_of
from gateway.api.silence_reach import reaches
from gateway.api.views_notices import delivery_view, route_view

__all__ = ["router"]

router = api_router("/api/v1/alert-routes", tags=["alerts"])


@router.get("", dependencies=[allow("alerts.read")], responses={200: {"model": models_watch.AlertRouteList}})
async def list_routes(request: Request, window: Paged) -> Response:
    """The routes that name no robot out of one's scope, in the file's order."""
    principal = principal_of(request)
    found = [one for one in services_of(request).notices.routes() if not one.robots or reaches(principal, one.robots)]
    return listing("routes", found, route_view, model=models_watch.AlertRoute, key=lambda one: one.name, window=window)


@router.post(
    "/{name}/test",
    dependencies=[allow("alerts.manage")],
    responses={200: {"model": models_watch.AlertRouteTest}, **PROBLEMS},
    openapi_extra=body_document(models_identity.Nothing),
)
async def test_route(request: Request, name: str) -> Response:
    """Send a notice that says that it is a test, and wait for what becomes of it."""
    require_all(request, "routes of notices")
    await read_body(request, models_identity.Nothing)
    done = await services_of(request).notices.test(name, by=principal_of(request).name)
    note(request, detail=f"{name[:64]}: {'delivered' if done.ok else 'failed'}")
    return JsonResponse(delivery_view(done))
