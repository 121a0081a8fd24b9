"""The table of checks: what is wrong by a rule, and from which bound on. It is one for the whole fleet."""

from __future__ import annotations

from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_all_robots, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note
from gateway.api.models import watch
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.services import services_of
from gateway.api.views.alerts import check_view
from gateway.errors import InvalidRequestError

__all__ = ["router"]

ANSWERS: dict[int | str, dict[str, Any]] = {200: {"model": watch.AlertCheck}, **PROBLEMS}

router = api_router("/api/v1/alert-checks", tags=["alerts"])


@router.get("", dependencies=[require_permission("alerts.read")], responses={200: {"model": watch.AlertCheckList}})
async def list_checks(request: Request, window: Paged) -> Response:
    """Every check as it is now, in the table's order."""
    found = services_of(request).watch.checks()
    return listing("checks", found, check_view, model=watch.AlertCheck, key=lambda row: row.id, window=window)


@router.put(
    "/{check_id}",
    dependencies=[require_permission("alerts.manage")],
    responses=ANSWERS,
    openapi_extra=body_document(watch.AlertCheckChange),
)
async def set_check(request: Request, check_id: str) -> Response:
    """Have a check be another for every robot, from now on; what is left out stays, and a null bound is none."""
    require_all_robots(request, "checks")
    body = await read_body(request, watch.AlertCheckChange)
    changes = body.said()
    if not changes:
        raise InvalidRequestError("say what is to change: enabled, low, high, for_s, clear_s or severity")
    row = await services_of(request).watch.set_check(check_id, changes, by=principal_of(request).name)
    note(request, detail=f"{row.id}: {', '.join(f'{name} {value}' for name, value in changes.items())}")
    return JsonResponse(check_view(row))


@router.delete("/{check_id}", dependencies=[require_permission("alerts.manage")], responses=ANSWERS)
async def reset_check(request: Request, check_id: str) -> Response:
    """Have a check be as it comes."""
    require_all_robots(request, "checks")
    row = await services_of(request).watch.reset_check(check_id, by=principal_of(request).name)
    note(request, detail=f"{row.id}: as it comes")
    return JsonResponse(check_view(row))
