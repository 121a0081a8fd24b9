"""Goals of robots' actions: begun, looked at, followed by server-sent events, cancelled."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note
from gateway.api.models import graph as models
from gateway.api.models.identity import Nothing
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.downloads import DownloadResponse
from gateway.api.rest.once import OnceGoal
from gateway.api.rest.sse import EVENT_STREAM, HEADERS, EventPieces, server_event
from gateway.api.services import services_of
from gateway.api.views.graph import goal_event_view, goal_view
from gateway.fleet.ros.errors import GoalRejectedError
from gateway.fleet.ros.goal import Goal, GoalEvent

__all__ = ["router"]

router = api_router("/api/v1/robots/{robot_id}", tags=["goals"])
FINISHED = {"code": "goal_over", "message": "nothing more comes of this goal"}


@router.post(
    "/actions/{action:path}",
    dependencies=[require_permission("robots.call")],
    status_code=202,
    responses={202: {"model": models.Goal, "headers": {"Location": {"schema": {"type": "string"}}}}, **PROBLEMS},
    openapi_extra=body_document(models.GoalRequest),
)
async def begin_goal(request: Request, robot_id: str, action: str) -> Response:
    """Begin a goal; answers when the server has taken it, with the goal's own path in `Location`.

    The action's name is relative to the robot's namespace, or full (`%2Fsim_1%2Fdock`). Without a type the robot's
    graph says it. 409 `goal_rejected` when the server does not take it. With an Idempotency-Key the same request begins
    one goal, and is answered with how that stands now.
    """
    body, services, principal = (
        await read_body(request, models.GoalRequest),
        services_of(request),
        principal_of(request),
    )
    once = OnceGoal(request, robot_id, {"action": action, "goal": body.model_dump()})
    goal = await once.find() or await services.goals.send(
        robot_id,
        action,
        type_name=body.type,
        goal=body.goal,
        timeout_s=body.timeout_s,
        lease_id=body.lease_id,
        sent_ns=body.sent_ns,
        by=principal.name,
        claim=once.claim,
    )
    note(request, detail=f"goal {goal.id} of {goal.action}: {goal.status}")
    if not once.settled(goal).accepted:
        raise GoalRejectedError(f"{goal.action} does not take the goal")
    where = f"/api/v1/robots/{robot_id}/goals/{goal.id}"
    return JsonResponse(goal_view(goal), status_code=202, headers={"Location": where})


@router.get(
    "/goals",
    dependencies=[require_permission("telemetry.read")],
    responses={200: {"model": models.GoalList}, **PROBLEMS},
)
async def list_goals(request: Request, robot_id: str, window: Paged) -> Response:
    """The goals of the robot that this gateway knows, the newest first; ended ones for ten minutes."""
    services = services_of(request)
    services.registry.get(robot_id)
    return listing(
        "goals", services.goals.of(robot_id), goal_view, model=models.Goal, key=lambda goal: goal.id, window=window
    )


@router.get(
    "/goals/{goal}",
    dependencies=[require_permission("telemetry.read")],
    responses={200: {"model": models.Goal}, **PROBLEMS},
)
async def get_goal(request: Request, robot_id: str, goal: str) -> Response:
    """How a goal stands, its newest feedback, and its result once there is one."""
    found = services_of(request).goals.find(robot_id, goal)
    return await asyncio.to_thread(lambda: JsonResponse(goal_view(found)))


@router.get(
    "/goals/{goal}/feedback",
    dependencies=[require_permission("telemetry.read")],
    response_class=Response,
    responses={200: {"content": {EVENT_STREAM: {}}}, **PROBLEMS},
)
async def follow_goal(request: Request, robot_id: str, goal: str) -> Response:
    """What is told of a goal, as server-sent events: how it stands, then `status`, `feedback`, and at last `result`.

    A slow reader gets the newest feedback, and every change of the status. After the result comes `end`.
    """
    found = services_of(request).goals.find(robot_id, goal)
    found.check_room()

    async def events() -> AsyncGenerator[GoalEvent, None]:
        async for event in found.events():
            yield event

    pieces = EventPieces(events(), lambda event: _written(found, event))
    return DownloadResponse(request, pieces, what="a goal's events", media_type=EVENT_STREAM, headers=HEADERS)


@router.post(
    "/goals/{goal}/cancel",
    dependencies=[require_permission("robots.call")],
    responses={200: {"model": models.Cancelled}, **PROBLEMS},
    openapi_extra=body_document(Nothing),
)
async def cancel_goal(request: Request, robot_id: str, goal: str) -> Response:
    """Ask the server to stop the goal; whether it will. Nothing is asked of a goal that has ended."""
    await read_body(request, Nothing)
    return JsonResponse({"canceling": await services_of(request).goals.cancel(robot_id, goal)})


def _written(goal: Goal, event: GoalEvent) -> bytes:
    return server_event(goal_event_view(goal, event), name=event.kind)
