"""Robots and their topics."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import APIRouter, Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api import models
from gateway.api.allow import allow, principal_of
from gateway.api.listing import After, FieldsText, ListLimit, Paged, listing, read_fields
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS
from gateway.api.rest.twin import Select
from gateway.api.robot_rows import RobotQuery, robot_rows_of
from gateway.api.services import services_of
from gateway.api.views import topic_view
from gateway.domain.selector import Selector
from gateway.ingest.registry import ChannelState
from metaros.limits import LIMITS

__all__ = ["router"]

router = APIRouter(prefix="/api/v1/robots", tags=["robots"], default_response_class=JsonResponse)


@router.get("", dependencies=[allow("robots.read")], responses={200: {"model": models.RobotList}, **PROBLEMS})
async def list_robots(
    request: Request,
    selector: Select = "",
    online: Annotated[bool | None, Query(description="only those that have a link, or have none")] = None,
    q: Annotated[str, Query(max_length=64, description="part of an id, a host name, or a label's value")] = "",
    limit: ListLimit = LIMITS.listed,
    after: After = "",
    fields: FieldsText = "",
) -> Response:
    """The robots that ever connected and that one sees, by id. What a link brings is at most a second old."""
    principal = principal_of(request)
    query = RobotQuery(
        sees=None if principal.sees_all else principal.sees,
        selector=Selector.parse(selector) if selector else None,
        online=online,
        text=q.lower(),
    )
    body, tag = await robot_rows_of(request).page(
        query, after=after, limit=limit, fields=read_fields(fields, models.Robot), text=fields
    )
    return Response(body, media_type="application/json", headers={"ETag": tag})


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
async def list_topics(request: Request, robot_id: str, window: Paged) -> Response:
    """What the robot announced, by name."""
    services = services_of(request)
    record = services.registry.get(robot_id)
    demand = services.demand_of(robot_id)

    def view(state: ChannelState) -> dict[str, Any]:
        return topic_view(state, demand)

    return listing("topics", record.topics(), view, model=models.Topic, key=_channel, window=window)


def _channel(state: ChannelState) -> str:
    return str(state.channel.channel_id)
