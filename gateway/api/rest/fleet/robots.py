"""Robots and their topics."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi.routing import APIRoute
from pydantic import Field
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import FIELDS, Paged, listing, read_fields
from gateway.api.models import common
from gateway.api.models.base import Model
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, query_document, read_query
from gateway.api.rest.fleet.twin import SELECTOR
from gateway.api.robot_rows import robot_rows_of
from gateway.api.robot_search import RobotQuery
from gateway.api.services import services_of
from gateway.api.views.robots import topic_view
from gateway.domain.fleet.selector import Selector
from gateway.ingest.registry import ChannelState
from metaros.limits import LIMITS

__all__ = ["FAST_PATHS", "router"]

router = api_router("/api/v1/robots", tags=["robots"])


class RobotsAsked(Model):
    """The query of the list of robots. Read in one go: a fleet's page is asked for more often than all else."""

    selector: Annotated[str, Field(max_length=4096, description=SELECTOR)] = ""
    online: Annotated[bool | None, Field(description="only those that have a link, or have none")] = None
    q: Annotated[str, Field(max_length=64, description="part of an id, a host name, or a label's value")] = ""
    limit: Annotated[int, Field(ge=1, le=LIMITS.listed, description="items of one page")] = LIMITS.listed
    after: Annotated[str, Field(max_length=600, description="the `next` of the page before")] = ""
    fields: Annotated[str, Field(max_length=2000, description=FIELDS)] = ""


@router.get(
    "",
    dependencies=[require_permission("robots.read")],
    responses={200: {"model": common.RobotList}, **PROBLEMS},
    openapi_extra=query_document(RobotsAsked),
)
async def list_robots(request: Request) -> Response:
    """The robots that ever connected and that one sees, by id. What a link brings is at most a second old."""
    asked = read_query(request, RobotsAsked)
    query = RobotQuery(
        scope=principal_of(request).robots,
        selector=Selector.parse(asked.selector) if asked.selector else None,
        online=asked.online,
        text=asked.q.lower(),
    )
    chosen = read_fields(asked.fields, common.Robot)
    body, tag = await robot_rows_of(request).page(
        query, after=asked.after, limit=asked.limit, fields=chosen, text=asked.fields
    )
    return Response(body, media_type="application/json", headers={"ETag": tag})


@router.get(
    "/{robot_id}",
    dependencies=[require_permission("robots.read")],
    responses={200: {"model": common.Robot}, 404: {"model": common.Problem}},
)
async def get_robot(request: Request, robot_id: str) -> Response:
    """One robot."""
    services = services_of(request)
    services.registry.get(robot_id)
    return JsonResponse(services.describe(robot_id))


@router.get(
    "/{robot_id}/topics",
    dependencies=[require_permission("robots.read")],
    responses={200: {"model": common.TopicList}, 404: {"model": common.Problem}},
)
async def list_topics(request: Request, robot_id: str, window: Paged) -> Response:
    """What the robot announced, by name."""
    services = services_of(request)
    record = services.registry.get(robot_id)
    demand = services.demand_of(robot_id)

    def view(state: ChannelState) -> dict[str, Any]:
        return topic_view(state, demand)

    return listing("topics", record.topics(), view, model=common.Topic, key=_channel, window=window)


FAST_PATHS = [route for route in router.routes if isinstance(route, APIRoute) and route.endpoint is list_robots]


def _channel(state: ChannelState) -> str:
    return str(state.channel.channel_id)
