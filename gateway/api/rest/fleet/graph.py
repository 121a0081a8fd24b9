"""Robots' parts of the ROS graph: nodes, who publishes and subscribes, services, actions."""

from __future__ import annotations

import asyncio
from operator import itemgetter
from typing import Any

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.models import graph as models
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS
from gateway.api.rest.fleet.twin import Select
from gateway.api.services import services_of
from gateway.api.views.graph import graph_view
from gateway.domain.fleet.selector import Selector

__all__ = ["router"]

router = api_router("/api/v1", tags=["graph"])


@router.get(
    "/graph", dependencies=[require_permission("robots.read")], responses={200: {"model": models.GraphList}, **PROBLEMS}
)
async def fleet_graph(request: Request, window: Paged, selector: Select = "") -> Response:
    """The graphs of the robots that one sees, and that told theirs; each with its robot's own names."""
    services, sees = services_of(request), principal_of(request).sees
    ids = [robot_id for robot_id in sorted(services.graphs.known()) if sees(robot_id)]
    if selector:
        wanted = Selector.parse(selector)
        ids = [one for one in ids if wanted.matches(one, services.twins.labels_of(one))]
    graphs = [services.graphs.of(robot_id) for robot_id in ids]

    def shown() -> Response:
        return listing(
            "robots", graphs, graph_view, model=models.RobotGraph, key=lambda graph: graph.robot, window=window
        )

    return await asyncio.to_thread(shown)


@router.get(
    "/robots/{robot_id}/graph",
    dependencies=[require_permission("robots.read")],
    responses={200: {"model": models.RobotGraph}, **PROBLEMS},
)
async def robot_graph(request: Request, robot_id: str) -> Response:
    """A robot's part of the graph, as its agent told it last; it stays while the robot's link is away."""
    graph = graph_of(request, robot_id)
    return await asyncio.to_thread(lambda: JsonResponse(graph_view(graph)))


@router.get(
    "/robots/{robot_id}/services",
    dependencies=[require_permission("robots.read")],
    responses={200: {"model": models.ServiceList}, **PROBLEMS},
)
async def list_services(request: Request, robot_id: str, window: Paged) -> Response:
    """The robot's services, by name."""
    rows = graph_view(graph_of(request, robot_id))["services"]
    return listing("services", rows, _same, model=models.GraphService, key=itemgetter("service"), window=window)


@router.get(
    "/robots/{robot_id}/actions",
    dependencies=[require_permission("robots.read")],
    responses={200: {"model": models.ActionList}, **PROBLEMS},
)
async def list_actions(request: Request, robot_id: str, window: Paged) -> Response:
    """The robot's actions, by name."""
    rows = graph_view(graph_of(request, robot_id))["actions"]
    return listing("actions", rows, _same, model=models.GraphAction, key=itemgetter("action"), window=window)


def graph_of(request: Request, robot_id: str) -> Any:
    """The graph of a robot; UnknownRobotError."""
    services = services_of(request)
    services.registry.get(robot_id)
    return services.graphs.of(robot_id)


def _same(row: dict[str, Any]) -> dict[str, Any]:
    return row
