"""Silences: for a while nobody is told of alerts that match."""

from __future__ import annotations

from starlette.requests import Request
from starlette.responses import Response

from gateway.alerting.alerts.errors import UnknownSilenceError
from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note
from gateway.api.models import alerts
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.once import once_of
from gateway.api.services import services_of
from gateway.api.silence_scope import check_silence_scope, sees_silence
from gateway.api.views.alerts import silence_view

__all__ = ["router"]

router = api_router("/api/v1/silences", tags=["alerts"])


@router.get("", dependencies=[require_permission("alerts.read")], responses={200: {"model": alerts.SilenceList}})
async def list_silences(request: Request, window: Paged) -> Response:
    """Those that are not over and reach no robot out of one's scope; the one that ends first is the first."""
    principal = principal_of(request)
    found = [one for one in await services_of(request).alerts.silences() if sees_silence(principal, one)]
    return listing("silences", found, silence_view, model=alerts.Silence, key=lambda one: one.id, window=window)


@router.post(
    "",
    status_code=201,
    dependencies=[require_permission("alerts.handle")],
    responses={201: {"model": alerts.Silence}, **PROBLEMS},
    openapi_extra=body_document(alerts.SilenceRequest),
)
async def add_silence(request: Request) -> Response:
    """Tell nobody of what matches. One of the whole fleet needs `alerts.manage`, others a scope that covers them.

    With the header `Idempotency-Key` the same request makes one, and is answered with how that stands now.
    """
    body = await read_body(request, alerts.SilenceRequest)
    services, principal = services_of(request), principal_of(request)
    check_silence_scope(principal, body.robots)
    made = await services.alerts.add_silence(
        robots=tuple(body.robots),
        causes=tuple(body.causes),
        up_to=body.up_to,
        until_ns=services.clock.wall_ns() + round(body.for_s * 1e9),
        reason=body.reason,
        by=principal.name,
        once=once_of(request, {"silence": body.model_dump()}),
    )
    robots, causes = " ".join(made.robots) or "the fleet", " ".join(made.causes) or "everything"
    note(request, detail=f"{made.id}: {causes} of {robots} for {body.for_s:g} s"[:500])
    return JsonResponse(silence_view(made), status_code=201)


@router.delete(
    "/{silence_id}",
    dependencies=[require_permission("alerts.handle")],
    responses={200: {"model": alerts.Silence}, **PROBLEMS},
)
async def end_silence(request: Request, silence_id: str) -> Response:
    """End it now."""
    manager, principal = services_of(request).alerts, principal_of(request)
    found = await manager.get_silence(silence_id)
    if not sees_silence(principal, found):
        raise UnknownSilenceError.of(silence_id)
    check_silence_scope(principal, found.robots)
    ended = await manager.end_silence(found.id, by=principal.name)
    note(request, detail=ended.id)
    return JsonResponse(silence_view(ended))
