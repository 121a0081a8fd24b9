"""The series of a robot: which there are, and pieces of them between two times."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.models import common
from gateway.api.problem import JsonResponse
from gateway.api.rest.times import parse_time
from gateway.api.services import services_of
from gateway.api.views.robots import metric_gaps_view, range_view, series_view
from gateway.errors import InvalidRequestError
from gateway.store.telemetry.series import Method

__all__ = ["router"]

MAX_SERIES = 64
MAX_POINTS = 10_000
MAX_GAPS = 1000
EARLIEST_NS = -(2**61)  # 1896

router = api_router("/api/v1/robots/{robot_id}/metrics", tags=["robots"])


@router.get(
    "",
    dependencies=[require_permission("telemetry.read")],
    responses={200: {"model": common.SeriesList}, 404: {"model": common.Problem}},
)
async def list_series(request: Request, robot_id: str, window: Paged) -> Response:
    """The robot's stored series."""
    services = services_of(request)
    services.registry.get(robot_id)
    found = await services.store.series(robot_id)
    return listing(
        "series", found, series_view, model=common.SeriesState, key=lambda facts: facts.series.name, window=window
    )


@router.get(
    "/range",
    dependencies=[require_permission("telemetry.read")],
    responses={200: {"model": common.MetricRange}, 404: {"model": common.Problem}},
)
async def get_range(
    request: Request,
    robot_id: str,
    name: Annotated[list[str], Query(max_length=MAX_SERIES, description="series name, once for each series")],
    start: Annotated[str, Query(description="RFC 3339, or relative like -15m")] = "-15m",
    end: Annotated[str, Query(description="RFC 3339, relative, or now")] = "now",
    points: Annotated[int, Query(ge=1, le=MAX_POINTS)] = 500,
    method: Annotated[Method, Query(description="buckets, or the rows that draw the same line")] = "buckets",
) -> Response:
    """Series between two times, and what was lost there.

    Rows when they are few, else that many buckets with mean, min, max and count, or that many rows by LTTB.
    """
    services = services_of(request)
    services.registry.get(robot_id)
    now_ns = services.clock.wall_ns()
    span = {"start_ns": parse_time(start, now_ns=now_ns), "end_ns": parse_time(end, now_ns=now_ns)}
    if span["end_ns"] <= span["start_ns"]:
        raise InvalidRequestError("end must be later than start")
    if span["start_ns"] < EARLIEST_NS:
        raise InvalidRequestError("start is too long ago")
    pieces = await services.store.range(robot_id, name, points=points, method=method, **span)
    gaps = await services.store.metric_gaps(robot_id, limit=MAX_GAPS, **span)
    return JsonResponse(
        {"series": [range_view(piece) for piece in pieces], "gaps": metric_gaps_view(gaps, pieces)},
    )
