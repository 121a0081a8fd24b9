"""Where notices of alerts go, as the file of `--notify` says, and whether they come."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_all_robots, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note
from gateway.api.models import identity, watch
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.services import services_of
from gateway.api.silence_scope import covers
from gateway.api.views.notices import delivery_view, route_view

__all__ = ["router"]

router = api_router("/api/v1/alert-routes", tags=["alerts"])


@router.get("", dependencies=[require_permission("alerts.read")], responses={200: {"model": watch.AlertRouteList}})
async def list_routes(request: Request, window: Paged) -> Response:
    """The routes that name no robot out of one's scope, in the file's order."""
    principal = principal_of(request)
    found = [one for one in services_of(request).notices.routes() if not one.robots or covers(principal, one.robots)]
    return listing("routes", found, route_view, model=watch.AlertRoute, key=lambda one: one.name, window=window)


@router.post(
    "/{name}/test",
    dependencies=[require_permission("alerts.manage")],
    responses={200: {"model": watch.AlertRouteTest}, **PROBLEMS},
    openapi_extra=body_document(identity.Nothing),
)
async def test_route(request: Request, name: str) -> Response:
    """Send a notice that says that it is a test, and wait for what becomes of it."""
    require_all_robots(request, "routes of notices")
    await read_body(request, identity.Nothing)
    done = await services_of(request).notices.test(name, by=principal_of(request).name)
    note(request, detail=f"{name[:64]}: {'delivered' if done.ok else 'failed'}")
    return JsonResponse(delivery_view(done))
