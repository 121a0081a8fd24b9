"""An MCAP file of stored messages, sent while it is made."""

from __future__ import annotations

from typing import Annotated

from fastapi import APIRouter, Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission, require_visible
from gateway.api.models import common
from gateway.api.rest.downloads import DownloadResponse
from gateway.api.rest.ranges import End, Start, Topics, chosen_topics, parse_range
from gateway.api.services import services_of
from gateway.api.views.history import compact_time
from gateway.errors import InvalidRequestError
from gateway.history.export import ExportRequest

__all__ = ["router"]

MAX_ROBOTS = 64
MEDIA_TYPE = "application/octet-stream"  # MCAP has no registered one

router = APIRouter(prefix="/api/v1", tags=["history"])


@router.get(
    "/export.mcap",
    dependencies=[require_permission("history.export")],
    response_class=Response,
    responses={
        200: {"content": {MEDIA_TYPE: {}}},
        **{status: {"model": common.Problem} for status in (400, 404, 429, 503)},
    },
)
async def export_mcap(
    request: Request,
    robot: Annotated[list[str], Query(max_length=MAX_ROBOTS, description="robot id, once for each")],
    topic: Topics = None,
    start: Start = "-15m",
    end: End = "now",
) -> Response:
    """Messages of some robots as one MCAP file, sorted by their stamps, with an index and an account of the losses."""
    services = services_of(request)
    start_ns, end_ns = parse_range(start, end, now_ns=services.clock.wall_ns())
    topics: dict[str, tuple[str, ...]] = {}
    for robot_id in dict.fromkeys(robot):
        require_visible(request, robot_id)
        namespace = services.registry.get(robot_id).robot.namespace
        names = await services.history.topic_names(robot_id)
        topics[robot_id] = chosen_topics(names, topic, namespace=namespace)
    if not topics:
        raise InvalidRequestError("robot is missing: name one at least")
    stream = services.history.export(ExportRequest(topics=topics, start_ns=start_ns, end_ns=end_ns))
    whose = next(iter(topics)) if len(topics) == 1 else f"{len(topics)}-robots"
    name = f"{whose}-{compact_time(start_ns)}.mcap"
    headers = {"Content-Disposition": f'attachment; filename="{name}"', "Cache-Control": "no-store"}
    return DownloadResponse(request, stream, what="an export", media_type=MEDIA_TYPE, headers=headers)
