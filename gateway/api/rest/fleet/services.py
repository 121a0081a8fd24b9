"""A robot's service under a path of its own: JSON in and out, or CDR in and out."""

from __future__ import annotations

from typing import Annotated, Any

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.models import common
from gateway.api.models import graph as graph_models
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.fleet.commands import called
from gateway.api.services import services_of
from gateway.fleet.command_manager import NewCommand
from metaros.limits import LIMITS

__all__ = ["router"]

router = api_router("/api/v1/robots", tags=["commands"])
CDR = "application/cdr"


@router.post(
    "/{robot_id}/services/{service:path}",
    dependencies=[require_permission("robots.call")],
    responses={200: {"model": common.CallResult, "content": {CDR: {}}}, **PROBLEMS},
    openapi_extra=body_document(graph_models.ServiceRequest, cdr=True),
)
async def call_named(
    request: Request,
    robot_id: str,
    service: str,
    type: Annotated[str, Query(max_length=256)] = "",  # noqa: A002
    timeout_s: Annotated[float, Query(gt=0, le=120)] = LIMITS.command_timeout_s,
    lease_id: str = "",
    sent_ns: Annotated[int, Query(ge=0, lt=2**63)] = 0,
) -> Response:
    """Call a service by its name, relative to the robot's namespace or full (`%2Fsim_1%2Freset`), and wait.

    Without a type the robot's graph says it. With a body of CDR the answer is CDR; the rest is in the query then.
    """
    services = services_of(request)
    if "json" in request.headers["content-type"]:
        body = await read_body(request, graph_models.ServiceRequest)
        asked = common.CallRequest(service=service, **body.model_dump())
        return JsonResponse({"response": await called(request, robot_id, asked)})
    raw = await request.body()
    noted: dict[str, Any] = {"service": service, "type": type, "cdr_bytes": len(raw)}
    order = NewCommand(robot=robot_id, kind="call_service", request=noted, timeout_s=timeout_s)
    with services.command_manager.track(order, principal_of(request)):
        answer: bytes = await services.fleet.call(
            robot_id,
            service,
            type_name=type,
            cdr=raw,
            raw=True,
            timeout_s=timeout_s,
            lease_id=lease_id,
            sent_ns=sent_ns,
        )
    return Response(answer, media_type=CDR)
