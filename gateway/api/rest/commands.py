"""What changes something on a robot: publish once, call a service."""

from __future__ import annotations

from typing import Any, TypeVar

from fastapi import APIRouter
from pydantic import BaseModel, ValidationError
from starlette.requests import Request
from starlette.responses import Response

from gateway.api import models
from gateway.api.problem import JsonResponse
from gateway.api.services import services_of
from gateway.errors import InvalidRequestError

__all__ = ["router"]

router = APIRouter(prefix="/api/v1/robots", tags=["commands"], default_response_class=JsonResponse)

Body = TypeVar("Body", bound=BaseModel)
_PROBLEMS: dict[int | str, dict[str, Any]] = {
    status: {"model": models.Problem} for status in (400, 404, 409, 413, 415, 502, 503, 504)
}


def _body(model: type[BaseModel], *, cdr: bool) -> dict[str, Any]:
    """The OpenAPI text of a body that the handler reads by itself."""
    content: dict[str, Any] = {"application/json": {"schema": model.model_json_schema()}}
    if cdr:
        content["application/cdr"] = {"schema": {"type": "string", "format": "binary"}}
    return {"requestBody": {"required": True, "content": content}}


async def _read(request: Request, model: type[Body]) -> Body:
    if "json" not in request.headers["content-type"]:
        raise InvalidRequestError("this request has a JSON body")
    try:
        return model.model_validate_json(await request.body())
    except ValidationError as error:
        faults = [f"{'.'.join(str(part) for part in item['loc'])}: {item['msg']}" for item in error.errors()]
        raise InvalidRequestError("; ".join(faults)[:1000]) from error


@router.post(
    "/{robot_id}/publish",
    responses={200: {"model": models.Ok}, **_PROBLEMS},
    openapi_extra=_body(models.PublishRequest, cdr=True),
)
async def publish(request: Request, robot_id: str, topic: str = "", type: str = "", lease_id: str = "") -> Response:  # noqa: A002
    """Publish once; JSON, or CDR with topic, type and lease_id in the query. Answers after the agent's result."""
    fleet = services_of(request).fleet
    if "json" in request.headers["content-type"]:
        body = await _read(request, models.PublishRequest)
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
    responses={200: {"model": models.CallResult}, **_PROBLEMS},
    openapi_extra=_body(models.CallRequest, cdr=False),
)
async def call_service(request: Request, robot_id: str) -> Response:
    """Call a service of the robot and wait for its response."""
    body = await _read(request, models.CallRequest)
    fleet = services_of(request).fleet
    response = await fleet.call(
        robot_id, body.service, type_name=body.type, request=body.request, timeout_s=body.timeout_s
    )
    return JsonResponse({"response": response})
