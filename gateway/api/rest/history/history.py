"""What is stored of a robot: its topics, how much when, messages, and the state of an instant."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.models import common, history
from gateway.api.problem import JsonResponse
from gateway.api.rest.ranges import End, Start, Topics, chosen_topics, full_pattern, parse_age, parse_range
from gateway.api.rest.times import parse_time
from gateway.api.services import Services, services_of
from gateway.api.views.history import history_view
from gateway.api.views.robots import rfc3339
from gateway.history.cursor import read_cursor
from gateway.history.pages import PageRequest

__all__ = ["RECORDS_TYPE", "router"]

RECORDS_TYPE = "application/x-metaros-records"
MAX_BUCKETS = 2000
MAX_MESSAGES = 1000

router = api_router("/api/v1/robots/{robot_id}", tags=["history"])

UNKNOWN: dict[int | str, dict[str, Any]] = {status: {"model": common.Problem} for status in (400, 404, 429, 503)}


@router.get(
    "/history",
    dependencies=[require_permission("history.read")],
    responses={200: {"model": history.History}, **UNKNOWN},
)
async def get_history(request: Request, robot_id: str) -> Response:
    """Which topics are stored, how much of them, from when to when."""
    services = services_of(request)
    services.registry.get(robot_id)
    topics, series = await services.history.stored(robot_id)
    return JsonResponse(history_view(topics, series=series))


@router.get(
    "/timeline",
    dependencies=[require_permission("history.read")],
    responses={200: {"model": history.Timeline}, **UNKNOWN},
)
async def get_timeline(
    request: Request,
    robot_id: str,
    start: Start = "-15m",
    end: End = "now",
    buckets: Annotated[int, Query(ge=1, le=MAX_BUCKETS)] = 240,
) -> Response:
    """How many messages and metric rows there are in each part of a range, and its losses."""
    services = services_of(request)
    services.registry.get(robot_id)
    start_ns, end_ns = parse_range(start, end, now_ns=services.clock.wall_ns())
    body = await services.history.timeline(robot_id, start_ns=start_ns, end_ns=end_ns, buckets=buckets)
    return _json(body)


@router.get(
    "/messages",
    dependencies=[require_permission("history.read")],
    responses={200: {"model": history.MessagePage}, **UNKNOWN},
)
async def get_messages(
    request: Request,
    robot_id: str,
    topic: Topics = None,
    start: Start = "-15m",
    end: End = "now",
    limit: Annotated[int, Query(ge=1, le=MAX_MESSAGES)] = 100,
    cursor: Annotated[str, Query(max_length=100, description="`next` of the page before")] = "",
    form: Annotated[Literal["json", "cdr"], Query(alias="format")] = "json",
    order: Literal["asc", "desc"] = "asc",
) -> Response:
    """Messages in order of their stamps, page by page."""
    services = services_of(request)
    start_ns, end_ns = parse_range(start, end, now_ns=services.clock.wall_ns())
    newest_first = order == "desc"
    asked = PageRequest(
        robot_id=robot_id,
        topics=await _topics(services, robot_id, topic),
        start_ns=start_ns,
        end_ns=end_ns,
        limit=limit,
        newest_first=newest_first,
        after=read_cursor(cursor, newest_first=newest_first) if cursor else None,
    )
    return _json(await services.history.page(asked, decoded=form == "json", show=rfc3339))


@router.get(
    "/at",
    dependencies=[require_permission("history.read")],
    responses={200: {"model": history.InstantMessages, "content": {RECORDS_TYPE: {}}}, **UNKNOWN},
)
async def get_instant(
    request: Request,
    robot_id: str,
    t: Annotated[str, Query(description="RFC 3339, relative, or now")],
    topic: Topics = None,
    max_age: Annotated[str, Query(description="how old a message may be, like 10s")] = "10s",
    form: Annotated[Literal["records", "json"], Query(alias="format")] = "records",
) -> Response:
    """The newest stored message of each topic at or before `t`: as the stream's records, or decoded."""
    services = services_of(request)
    t_ns, max_age_ns = parse_time(t, now_ns=services.clock.wall_ns()), parse_age(max_age)
    namespace = services.registry.get(robot_id).robot.namespace
    # What is asked for by its very name is in the answer, stored or not.
    topics = tuple(dict.fromkeys(full_pattern(name, namespace) for name in topic or () if "*" not in name))
    if topic is None or any("*" in name for name in topic):
        topics = tuple(dict.fromkeys([*topics, *await _topics(services, robot_id, topic)]))
    show = rfc3339 if form == "json" else None
    body = await services.history.snapshot(robot_id, topics, t_ns=t_ns, max_age_ns=max_age_ns, show=show)
    return _json(body) if show is not None else Response(body, media_type=RECORDS_TYPE)


async def _topics(services: Services, robot_id: str, patterns: list[str] | None) -> tuple[str, ...]:
    """The robot's stored topics that are asked for."""
    namespace = services.registry.get(robot_id).robot.namespace
    names = await services.history.topic_names(robot_id)
    return chosen_topics(names, patterns, namespace=namespace)


def _json(body: bytes) -> Response:
    return Response(body, media_type=JsonResponse.media_type)
