"""What is watched of a robot: how far its series are learned, and what was expected of one."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.models import common, watch
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS
from gateway.api.rest.ranges import parse_range
from gateway.api.services import services_of
from gateway.api.views.alerts import point_view, series_watch_view

__all__ = ["router"]

From = Annotated[str, Query(alias="from", max_length=64, description="RFC 3339, or relative like -15m")]
To = Annotated[str, Query(max_length=64, description="RFC 3339, relative, or now")]

router = api_router("/api/v1/robots/{robot_id}/watch", tags=["alerts"])


@router.get(
    "",
    dependencies=[require_permission("alerts.read")],
    responses={200: {"model": watch.Watch}, 404: {"model": common.Problem}},
)
async def get_watch(request: Request, robot_id: str, window: Paged) -> Response:
    """The robot's series by name: which are learned still, and how odd each is now."""
    services = services_of(request)
    services.registry.get(robot_id)
    found = await services.watch.learning(robot_id)
    return listing(
        "series", found, series_watch_view, model=watch.SeriesWatch, key=lambda one: one.series, window=window
    )


@router.get(
    "/band",
    dependencies=[require_permission("alerts.read")],
    responses={200: {"model": watch.Band}, **PROBLEMS},
)
async def get_band(
    request: Request,
    robot_id: str,
    series: Annotated[str, Query(min_length=1, max_length=256)],
    from_: From = "-15m",
    to: To = "now",
) -> Response:
    """A series and what was expected of it, by the robot's stamps, as far as the gateway remembers."""
    services = services_of(request)
    services.registry.get(robot_id)
    start_ns, end_ns = parse_range(from_, to, now_ns=services.clock.wall_ns())
    points = await services.watch.band(robot_id, series, start_ns, end_ns)
    return JsonResponse({"robot": robot_id, "series": series, "points": [point_view(point) for point in points]})
