"""A robot's link: its byte budget, and the losses it declared."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import FieldsText, read_fields
from gateway.api.middleware.conditional import matches
from gateway.api.models import common
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.once import carried_once, key_of
from gateway.api.services import services_of
from gateway.api.views.robots import gap_view, uplink_view
from gateway.domain.errors import ChangedError
from gateway.fleet.command_manager import NewCommand

__all__ = ["router"]

MAX_GAPS = 1000

router = api_router("/api/v1/robots", tags=["link"])


@router.get(
    "/{robot_id}/uplink",
    dependencies=[require_permission("robots.read")],
    responses={200: {"model": common.Uplink}, 404: {"model": common.Problem}},
)
async def get_uplink(request: Request, robot_id: str) -> Response:
    """The robot's byte budget, as its agent said last."""
    view = uplink_view(services_of(request).registry.get(robot_id))
    return JsonResponse(view, headers={"ETag": _tag(view)})


@router.put(
    "/{robot_id}/uplink",
    dependencies=[require_permission("robots.configure")],
    responses={200: {"model": common.Uplink}, **PROBLEMS, 412: {"model": common.Problem}},
    openapi_extra=body_document(common.UplinkRequest),
)
async def set_uplink(request: Request, robot_id: str) -> Response:
    """Give the robot another byte budget. Answers when its agent has taken it and keeps it."""
    services = services_of(request)
    body = await read_body(request, common.UplinkRequest)
    tag = _tag(uplink_view(services.registry.get(robot_id)))
    if (said := request.headers.get("if-match", "*")) != "*" and not matches(said, tag):
        raise ChangedError(f"the byte budget of {robot_id} is another one by now: read it again")
    if (key := key_of(request)) is not None:
        order = NewCommand(
            robot=robot_id, kind="set_uplink", request={"bytes_per_s": body.bytes_per_s}, idempotency=key
        )
        await carried_once(request, order)
    else:
        await services.fleet.set_uplink(robot_id, body.bytes_per_s)
    record = services.registry.get(robot_id)
    record.budgeted(body.bytes_per_s)
    view = uplink_view(record)
    return JsonResponse(view, headers={"ETag": _tag(view)})


@router.get(
    "/{robot_id}/gaps",
    dependencies=[require_permission("robots.read")],
    responses={200: {"model": common.GapList}, 404: {"model": common.Problem}},
)
async def list_gaps(
    request: Request,
    robot_id: str,
    limit: Annotated[int, Query(ge=1, le=MAX_GAPS)] = 50,
    fields: FieldsText = "",
) -> Response:
    """The newest declared losses."""
    services = services_of(request)
    record = services.registry.get(robot_id)
    found = await services.store.gaps(robot_id, limit=limit)
    chosen = read_fields(fields, common.DeclaredGap)
    return JsonResponse({"gaps": [chosen.of(gap_view(record, gap)) for gap in found]})


def _tag(view: dict[str, Any]) -> str:
    """Of the budget alone: what is sent changes all the time."""
    return f'"{view["bytes_per_s"] or 0}"'
