"""For operators: metrics for Prometheus, followed samples, and a report for a bug."""

from __future__ import annotations

import asyncio
from typing import Annotated

from fastapi import APIRouter, Query
from starlette.requests import Request
from starlette.responses import PlainTextResponse, Response

from gateway.api.authorization import principal_of, require_all_robots, require_permission
from gateway.api.models import ops as models
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of
from gateway.ops.meters import text_of
from gateway.ops.report import as_text

__all__ = ["router"]

router = APIRouter(tags=["operations"])


@router.get(
    "/metrics",
    dependencies=[require_permission("metrics.read")],
    responses={
        200: {
            "content": {"text/plain": {}, "application/openmetrics-text": {}},
            "description": "Prometheus's text format, or OpenMetrics",
        }
    },
    response_class=Response,
)
async def metrics(request: Request) -> Response:
    """What the gateway counts, for Prometheus; see docs/reference/metrics.md. Needs the scope of all robots."""
    require_all_robots(request, "the gateway's metrics")
    services = services_of(request)
    families = await services.families()
    accept = request.headers.get("accept", "")
    body, content_type = await asyncio.to_thread(text_of, services.meters, families, accept=accept)
    return Response(body, headers={"content-type": content_type})


@router.get(
    "/api/v1/traces",
    dependencies=[require_permission("telemetry.read")],
    responses={200: {"model": models.Traces}},
    response_class=JsonResponse,
)
async def traces(
    request: Request,
    robot: Annotated[str, Query(max_length=256, description="Only of this robot.")] = "",
    topic: Annotated[str, Query(max_length=256, description="Only of this topic, by its full name.")] = "",
    limit: Annotated[int, Query(ge=1, le=256)] = 50,
) -> Response:
    """The newest samples that were followed from their robot to viewers and row, with the time of each stage."""
    sees = principal_of(request).sees
    found = services_of(request).traces.newest(robot=robot, topic=topic, sees=sees, limit=limit)
    return JsonResponse({"traces": [journey.document() for journey in found]})


@router.get(
    "/api/v1/debug",
    dependencies=[require_permission("debug.read")],
    responses={200: {"model": models.Debug, "content": {"text/plain": {}}}},
    response_class=JsonResponse,
)
async def debug(
    request: Request,
    form: Annotated[
        str, Query(alias="format", pattern="^(json|text)$", description="json, or text for a person.")
    ] = "json",
) -> Response:
    """Tasks, threads, memory, queues, settings without their secrets: what a bug report needs."""
    require_all_robots(request, "the gateway's report")
    report = await services_of(request).report()
    return JsonResponse(report) if form == "json" else PlainTextResponse(as_text(report) + "\n")
