"""Robots and their topics."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from gateway.api import models
from gateway.api.allow import allow, principal_of
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of
from gateway.api.views import topic_view

__all__ = ["router"]

router = APIRouter(prefix="/api/v1/robots", tags=["robots"], default_response_class=JsonResponse)


@router.get("", dependencies=[allow("robots.read")], responses={200: {"model": models.RobotList}})
async def list_robots(request: Request) -> Response:
    """Every robot that ever connected and that one sees, by id."""
    services, sees = services_of(request), principal_of(request).sees
    ids = (record.robot.id for record in services.registry.all())
    return JsonResponse({"robots": [services.describe(robot_id) for robot_id in ids if sees(robot_id)]})


@router.get(
    "/{robot_id}",
    dependencies=[allow("robots.read")],
    responses={200: {"model": models.Robot}, 404: {"model": models.Problem}},
)
async def get_robot(request: Request, robot_id: str) -> Response:
    """One robot."""
    services = services_of(request)
    services.registry.get(robot_id)
    return JsonResponse(services.describe(robot_id))


@router.get(
    "/{robot_id}/topics",
    dependencies=[allow("robots.read")],
    responses={200: {"model": models.TopicList}, 404: {"model": models.Problem}},
)
async def list_topics(request: Request, robot_id: str) -> Response:
    """What the robot announced, by name."""
    services = services_of(request)
    record = services.registry.get(robot_id)
    demand = services.demand_of(robot_id)
    return JsonResponse({"topics": [topic_view(state, demand) for state in record.topics()]})
