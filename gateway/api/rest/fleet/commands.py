"""What changes something on a robot: publish once, call a service."""

from __future__ import annotations

import base64
from dataclasses import replace
from typing import Annotated, Any

import orjson
from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.models import common
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.once import carried_once, key_of
from gateway.api.services import services_of
from gateway.errors import CommandRefusedError, InvalidRequestError
from gateway.fleet.command_manager import NewCommand
from metaros.limits import LIMITS

__all__ = ["called", "router"]

router = api_router("/api/v1/robots", tags=["commands"])


@router.post(
    "/{robot_id}/publish",
    dependencies=[require_permission("robots.publish")],
    responses={200: {"model": common.Ok}, **PROBLEMS},
    openapi_extra=body_document(common.PublishRequest, cdr=True),
)
async def publish(
    request: Request,
    robot_id: str,
    topic: str = "",
    type: str = "",  # noqa: A002
    lease_id: str = "",
    sent_ns: Annotated[int, Query(ge=0, lt=2**63)] = 0,
) -> Response:
    """Publish once; JSON, or CDR with topic, type, lease_id and sent_ns in the query. Answers after the agent's result.

    `sent_ns` is the client's wall clock, 0 = now: what moves the robot is refused (`stale`) when it is too old.
    """
    services, raw = services_of(request), await request.body()
    if "json" in request.headers["content-type"]:
        body, cdr = await read_body(request, common.PublishRequest), None
    else:
        if not topic:
            raise InvalidRequestError("a CDR body needs the query parameter topic")
        body, cdr = common.PublishRequest(topic=topic, type=type, lease_id=lease_id, sent_ns=sent_ns), raw
    asked: dict[str, Any] = {"topic": body.topic, "type": body.type}
    if (key := key_of(request)) is not None:
        asked |= {"message": body.message} if cdr is None else {"cdr": base64.b64encode(raw).decode()}
        asked["lease_id"] = body.lease_id
        order = NewCommand(robot=robot_id, kind="publish", request=asked, idempotency=key, sent_ns=body.sent_ns)
        await carried_once(request, order)
        return JsonResponse({"ok": True})
    asked |= {"message": body.message} if cdr is None else {"cdr_bytes": len(raw)}
    with services.command_manager.track(
        NewCommand(robot=robot_id, kind="publish", request=asked), principal_of(request)
    ):
        await services.fleet.publish(
            robot_id,
            body.topic,
            type_name=body.type,
            message=body.message,
            cdr=cdr,
            lease_id=body.lease_id,
            sent_ns=body.sent_ns,
        )
    return JsonResponse({"ok": True})


@router.post(
    "/{robot_id}/services/call",
    dependencies=[require_permission("robots.call")],
    responses={200: {"model": common.CallResult}, **PROBLEMS},
    openapi_extra=body_document(common.CallRequest, cdr=False),
)
async def call_service(request: Request, robot_id: str) -> Response:
    """Call a service of the robot and wait for its response."""
    body = await read_body(request, common.CallRequest)
    return JsonResponse({"response": await called(request, robot_id, body)})


async def called(request: Request, robot_id: str, body: common.CallRequest) -> Any:
    """What a service answers, as JSON-able values; with an Idempotency-Key carried out once."""
    services = services_of(request)
    asked = {"service": body.service, "type": body.type, "request": body.request}
    order = NewCommand(robot=robot_id, kind="call_service", request=asked, timeout_s=body.timeout_s)
    if (key := key_of(request)) is not None:
        asked |= {"lease_id": body.lease_id, "type": services.fleet.service_type(robot_id, body.service, body.type)}
        ended = await carried_once(request, replace(order, idempotency=key, sent_ns=body.sent_ns))
        if not ended.result:
            text = f"it was carried out, and its answer of over {LIMITS.result_bytes} bytes was not kept"
            raise CommandRefusedError(text, agent_code="too_large")
        return orjson.loads(ended.result)
    with services.command_manager.track(order, principal_of(request)) as noted:
        response = noted.result = await services.fleet.call(
            robot_id,
            body.service,
            type_name=body.type,
            request=body.request,
            timeout_s=body.timeout_s,
            lease_id=body.lease_id,
            sent_ns=body.sent_ns,
        )
    return response
