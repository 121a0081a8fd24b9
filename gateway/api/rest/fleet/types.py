"""Types: what the messages of a robot's topics, services and actions are made of."""

from __future__ import annotations

import asyncio

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.models import common
from gateway.api.models.types import TypeShape
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of
from gateway.fleet.ros.types import TypeRegistry

__all__ = ["router"]

router = api_router("/api/v1/robots", tags=["robots"])


@router.get(
    "/{robot_id}/types/{package}/{kind}/{name}",
    dependencies=[require_permission("robots.read")],
    responses={200: {"model": TypeShape}, 404: {"model": common.Problem}},
)
async def get_type(request: Request, robot_id: str, package: str, kind: str, name: str) -> Response:
    """What a type is made of: as the robot announced it with a topic or told it, else as the library ships it."""
    services, full = services_of(request), f"{package}/{kind}/{name}"
    topics = services.registry.get(robot_id).topics()
    announced = next((state.channel for state in topics if state.channel.schema_name == full), None)
    told = services.graphs.of(robot_id).told(full)
    return JsonResponse(await asyncio.to_thread(TypeRegistry().shape, full, announced, told))
