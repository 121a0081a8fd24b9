"""What changes something on a robot: publish once, call a service."""

from __future__ import annotations

from fastapi import APIRouter
from starlette.requests import Request
from starlette.responses import Response

from gateway.api import models
from gateway.api.allow import allow
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.services import services_of
from gateway.errors import InvalidRequestError

__all__ = ["router"]

router = APIRouter(prefix="/api/v1/robots", tags=["commands"], default_response_class=JsonResponse)


@router.post(
    "/{robot_id}/publish",
    dependencies=[allow("robots.publish")],
    responses={200: {"model": models.Ok}, **PROBLEMS},
    openapi_extra=body_document(models.PublishRequest, cdr=True),
)
async def publish(request: Request, robot_id: str, topic: str = "", type: str = "", lease_id: str = "") -> Response:  # noqa: A002
    """Publish once; JSON, or CDR with topic, type and lease_id in the query. Answers after the agent's result."""
    fleet = services_of(request).fleet
    if "json" in request.headers["content-type"]:
        body = await read_body(request, models.PublishRequest)
        size = len(await request.body())
        await fleet.publish(
            robot_id,
            body.topic,
            type_name=body.type,
            message=body.message,
            size_hint_bytes=size,
            lease_id=body.lease_id,
        )
    else:
        if not topic:
            raise InvalidRequestError("a CDR body needs the query parameter topic")
        await fleet.publish(robot_id, topic, type_name=type, cdr=await request.body(), lease_id=lease_id)
    return JsonResponse({"ok": True})


@router.post(
    "/{robot_id}/services/call",
    dependencies=[allow("robots.call")],
    responses={200: {"model": models.CallResult}, **PROBLEMS},
    openapi_extra=body_document(models.CallRequest, cdr=False),
)
async def call_service(request: Request, robot_id: str) -> Response:
    """Call a service of the robot and wait for its response."""
    body = await read_body(request, models.CallRequest)
    fleet = services_of(request).fleet
    response = await fleet.call(
        robot_id, body.service, type_name=body.type, request=body.request, timeout_s=body.timeout_s
    )
    return JsonResponse({"response": response})
