"""Parameters and lifecycle of a robot's running nodes, by the nodes' own services."""

from __future__ import annotations

from typing import Annotated

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_permission
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.models import nodes as models
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.fleet.nodes import actor_of
from gateway.api.rest.fleet.twin import DryRun, Reason
from gateway.api.services import services_of
from gateway.api.views.nodes import lifecycle_view, parameter_view
from gateway.errors import InvalidRequestError
from gateway.fleet.nodes.values import NodeValues

__all__ = ["router"]

RosName = Annotated[
    str, Query(max_length=256, description="another ROS node of the robot than the one of the table's name")
]
NAME_CHARS = 256

router = api_router("/api/v1/robots/{robot_id}/nodes/{node}", tags=["nodes"])


@router.get(
    "/parameters",
    dependencies=[require_permission("nodes.read")],
    responses={200: {"model": models.Parameters}, **PROBLEMS},
)
async def get_parameters(request: Request, robot_id: str, node: str, ros_name: RosName = "") -> Response:
    """The running node's parameters, with their types, rules and values."""
    values = _values(request)
    name = await values.full_name(robot_id, node, ros_name)
    found = [parameter_view(item) for item in await values.parameters(robot_id, name)]
    return JsonResponse({"robot": robot_id, "node": name, "parameters": found})


@router.patch(
    "/parameters",
    dependencies=[require_permission("nodes.control")],
    responses={200: {"model": models.ParametersChanged}, **PROBLEMS},
    openapi_extra=body_document(models.ParametersChange),
)
async def set_parameters(
    request: Request, robot_id: str, node: str, ros_name: RosName = "", dry_run: DryRun = False, reason: Reason = ""
) -> Response:
    """Set parameters of the running node, each for itself; with `keep` they are the twin's as well."""
    body, values = await read_body(request, models.ParametersChange), _values(request)
    for name in body.parameters:
        if not 0 < len(name) <= NAME_CHARS or "\0" in name:
            raise InvalidRequestError(f"parameters: a name has 1 to {NAME_CHARS} characters without NUL")
    full = await values.full_name(robot_id, node, ros_name)
    results, edited = await values.set_parameters(
        robot_id, full, body.parameters, actor_of(request, reason), keep=body.keep, dry_run=dry_run
    )
    done = sum(1 for item in results if item.successful)
    note(request, detail=f"{'dry run: ' if dry_run else ''}{full}: {done} of {len(results)} parameters")
    return JsonResponse(
        {
            "robot": robot_id,
            "node": full,
            "dry_run": dry_run,
            "results": [{"name": item.name, "successful": item.successful, "reason": item.reason} for item in results],
            "revision": edited.after.revision if edited is not None else None,
        }
    )


@router.get(
    "/lifecycle",
    dependencies=[require_permission("nodes.read")],
    responses={200: {"model": models.Lifecycle}, **PROBLEMS},
)
async def get_lifecycle(request: Request, robot_id: str, node: str, ros_name: RosName = "") -> Response:
    """The node's lifecycle state and where it may go from there; `managed` is false for a node that has none."""
    values = _values(request)
    name = await values.full_name(robot_id, node, ros_name)
    return JsonResponse(lifecycle_view(robot_id, name, await values.lifecycle(robot_id, name)))


@router.post(
    "/lifecycle",
    dependencies=[require_permission("nodes.control")],
    responses={200: {"model": models.LifecycleChanged}, **PROBLEMS},
    openapi_extra=body_document(models.LifecycleChange),
)
async def change_lifecycle(
    request: Request, robot_id: str, node: str, ros_name: RosName = "", dry_run: DryRun = False, reason: Reason = ""
) -> Response:
    """Have the node make a transition; `success` is false where it stays what it is."""
    body, values = await read_body(request, models.LifecycleChange), _values(request)
    name = await values.full_name(robot_id, node, ros_name)
    success, now, edited = await values.change_state(
        robot_id, name, body.transition, actor_of(request, reason), keep=body.keep, dry_run=dry_run
    )
    note(request, detail=f"{'dry run: ' if dry_run else ''}{name}: {body.transition}, now {now.state}")
    revision = edited.after.revision if edited is not None else None
    view = lifecycle_view(robot_id, name, now)
    return JsonResponse({**view, "dry_run": dry_run, "success": success, "revision": revision})


def _values(request: Request) -> NodeValues:
    return services_of(request).nodes.values
