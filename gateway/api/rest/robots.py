"""Robots, their topics and their series."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api import models
from gateway.api.problem import JsonResponse
from gateway.api.rest.times import parse_time
from gateway.api.services import services_of
from gateway.api.views import range_view, series_view, topic_view
from gateway.errors import InvalidRequestError

__all__ = ["router"]

MAX_SERIES = 64
MAX_POINTS = 10_000

router = APIRouter(prefix="/api/v1/robots", tags=["robots"], default_response_class=JsonResponse)


@router.get("", responses={200: {"model": models.RobotList}})
async def list_robots(request: Request) -> Response:
    """Every robot that ever connected, by id."""
    services = services_of(request)
    return JsonResponse({"robots": [services.describe(record.robot.id) for record in services.registry.all()]})


@router.get("/{robot_id}", responses={200: {"model": models.Robot}, 404: {"model": models.Problem}})
async def get_robot(request: Request, robot_id: str) -> Response:
    """One robot."""
    services = services_of(request)
    services.registry.get(robot_id)
    return JsonResponse(services.describe(robot_id))


@router.get("/{robot_id}/topics", responses={200: {"model": models.TopicList}, 404: {"model": models.Problem}})
async def list_topics(request: Request, robot_id: str) -> Response:
    """What the robot announced, by name."""
    services = services_of(request)
    record = services.registry.get(robot_id)
    demand = services.demand_of(robot_id)
    return JsonResponse({"topics": [topic_view(state, demand) for state in record.topics()]})


@router.get("/{robot_id}/metrics", responses={200: {"model": models.SeriesList}, 404: {"model": models.Problem}})
async def list_series(request: Request, robot_id: str) -> Response:
    """The robot's stored series."""
    services = services_of(request)
    services.registry.get(robot_id)
    return JsonResponse({"series": [series_view(facts) for facts in await services.store.series(robot_id)]})


@router.get("/{robot_id}/metrics/range", responses={200: {"model": models.MetricRange}, 404: {"model": models.Problem}})
async def get_range(
    request: Request,
    robot_id: str,
    name: Annotated[list[str], Query(max_length=MAX_SERIES, description="series name, once for each series")],
    start: Annotated[str, Query(description="RFC 3339, or relative like -15m")] = "-15m",
    end: Annotated[str, Query(description="RFC 3339, relative, or now")] = "now",
    points: Annotated[int, Query(ge=1, le=MAX_POINTS)] = 500,
) -> Response:
    """Series between two times: rows when they are few, else that many buckets with mean, min, max and count."""
    services = services_of(request)
    services.registry.get(robot_id)
    now_ns = services.clock.wall_ns()
    start_ns, end_ns = parse_time(start, now_ns=now_ns), parse_time(end, now_ns=now_ns)
    if end_ns <= start_ns:
        raise InvalidRequestError("end must be later than start")
    pieces = await services.store.range(robot_id, name, start_ns=start_ns, end_ns=end_ns, points=points)
    return JsonResponse({"series": [range_view(piece) for piece in pieces]})
