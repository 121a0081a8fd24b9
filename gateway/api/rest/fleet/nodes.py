"""Robots' nodes: how they do, what they have said, start and stop, and their rows of the twin; of one or of many."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, AsyncIterator, Mapping, Sequence
from contextlib import aclosing
from dataclasses import replace
from itertools import islice
from typing import Annotated, Any, Literal

import orjson
from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.middleware.audited import note
from gateway.api.models import nodes as models
from gateway.api.models.twin import TwinChange, TwinsChange
from gateway.api.problem import JsonResponse, error_code
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.downloads import DownloadResponse
from gateway.api.rest.fleet.twin import (
    ANY_OBJECT,
    PRECONDITIONS,
    DryRun,
    Reason,
    Select,
    Window,
    document_of,
    editor_of,
    expected_of,
    outcome_answer,
)
from gateway.api.rest.once import carried_once, key_of
from gateway.api.services import services_of
from gateway.api.views.nodes import crash_view, log_view, node_view, nodes_view, result_view, results_view
from gateway.api.views.twin import outcomes_view
from gateway.domain.fleet.selector import Selector
from gateway.fleet.nodes.logs import LogPage
from gateway.fleet.nodes.manager import NodeManager, RobotNodes
from gateway.fleet.nodes.verbs import Actor, NodeAction, Result
from metaros.errors import MetarosError
from metaros.limits import LIMITS

__all__ = ["actor_of", "router"]

Verb = Literal["start", "stop", "restart", "retry", "signal"]
Cursor = Annotated[str, Query(max_length=20, description="where an earlier answer ended; none: the newest lines")]
Text = Annotated[str, Query(max_length=256, description="only lines that hold this text, whatever its case")]
Backwards = Annotated[bool, Query(description="older lines than the cursor")]
PageBytes = Annotated[int, Query(ge=256, le=LIMITS.result_bytes)]
Limit = Annotated[int, Query(ge=1, le=LIMITS.nodes_listed)]
EVENTS = "text/event-stream"

router = api_router("/api/v1", tags=["nodes"])


@router.get(
    "/nodes", dependencies=[require_permission("nodes.read")], responses={200: {"model": models.NodeList}, **PROBLEMS}
)
async def list_nodes(
    request: Request, selector: Select = "", state: str = "", node: str = "", limit: Limit = 1000
) -> Response:
    """The nodes of every robot that the selector names and that one sees; of one state, or of one name."""
    robots = await services_of(request).nodes.manager.of_many(Selector.parse(selector), principal_of(request).sees)
    return await asyncio.to_thread(_listed, robots, state, node, limit)


@router.post(
    "/nodes/{verb}",
    dependencies=[require_permission("nodes.control")],
    responses={200: {"model": models.NodeResults}, **PROBLEMS},
    openapi_extra=body_document(models.VerbForMany),
)
async def act_on_many(request: Request, verb: Verb, dry_run: DryRun = False, reason: Reason = "") -> Response:
    """A verb for a node of every robot that the selector names. What robots make of it is told one by one."""
    body = await read_body(request, models.VerbForMany)
    selector, action = Selector.parse(body.selector), NodeAction(node=body.node, verb=verb, signal=body.signal)
    results = await services_of(request).nodes.verbs.act_many(
        selector, action, actor_of(request, reason or verb), sees=principal_of(request).sees, dry_run=dry_run
    )
    view = await asyncio.to_thread(results_view, results)
    note(
        request,
        detail=f"{'dry run: ' if dry_run else ''}{verb} {action.node}: {view['done']} of {view['robots']} robots",
    )
    return JsonResponse(view)


@router.patch(
    "/nodes/{node}",
    dependencies=[require_permission("nodes.control")],
    responses={200: {"model": TwinsChange}, **PROBLEMS},
    openapi_extra=ANY_OBJECT,
)
async def change_many(
    request: Request,
    node: str,
    selector: Select,
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_within_s: Window = None,
) -> Response:
    """A merge patch of that node's row, for every robot named whose twin has it: all of them, or none."""
    patch, editor = await document_of(request), editor_of(request, reason=reason, window=confirm_within_s)
    outcomes = await services_of(request).nodes.manager.change_many(
        Selector.parse(selector), node, patch, editor, sees=principal_of(request).sees, dry_run=dry_run
    )
    view = await asyncio.to_thread(outcomes_view, outcomes, dry_run=dry_run)
    note(request, detail=f"{'dry run: ' if dry_run else ''}{node}: {view['changed']} robots")
    return JsonResponse(view)


@router.get(
    "/robots/{robot_id}/nodes",
    dependencies=[require_permission("nodes.read")],
    responses={200: {"model": models.RobotNodes}, **PROBLEMS},
)
async def robot_nodes(request: Request, robot_id: str) -> Response:
    """A robot's nodes: as they are to be, as the robot says they are, and why they differ."""
    found = await services_of(request).nodes.manager.of_robot(robot_id)
    return await asyncio.to_thread(lambda: JsonResponse(nodes_view(found)))


@router.get(
    "/robots/{robot_id}/nodes/{node}",
    dependencies=[require_permission("nodes.read")],
    responses={200: {"model": models.Node}, **PROBLEMS},
)
async def one_node(request: Request, robot_id: str, node: str) -> Response:
    """One of them."""
    found = await services_of(request).nodes.manager.of_robot(robot_id)
    return JsonResponse(node_view(found.get(node), in_own=node in found.own))


@router.patch(
    "/robots/{robot_id}/nodes/{node}",
    dependencies=[require_permission("nodes.control")],
    responses={200: {"model": TwinChange}, **PRECONDITIONS},
    openapi_extra=ANY_OBJECT,
)
async def change_node(
    request: Request,
    robot_id: str,
    node: str,
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_within_s: Window = None,
) -> Response:
    """A merge patch of the node's row in the robot's own document; what it runs is an admin's to change."""
    patch, editor = await document_of(request), editor_of(request, reason=reason, window=confirm_within_s)
    outcome = await _manager(request).change(
        robot_id, node, patch, editor, expected=expected_of(request), dry_run=dry_run
    )
    return await outcome_answer(request, outcome, dry_run=dry_run)


@router.put(
    "/robots/{robot_id}/nodes/{node}",
    dependencies=[require_permission("nodes.control")],
    responses={200: {"model": TwinChange}, **PRECONDITIONS},
    openapi_extra=ANY_OBJECT,
)
async def put_node(
    request: Request,
    robot_id: str,
    node: str,
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_within_s: Window = None,
) -> Response:
    """Give the robot this node, or this row of it, whatever templates say."""
    row, editor = await document_of(request), editor_of(request, reason=reason, window=confirm_within_s)
    outcome = await _manager(request).put(robot_id, node, row, editor, expected=expected_of(request), dry_run=dry_run)
    return await outcome_answer(request, outcome, dry_run=dry_run)


@router.delete(
    "/robots/{robot_id}/nodes/{node}",
    dependencies=[require_permission("nodes.control")],
    responses={200: {"model": TwinChange}, **PRECONDITIONS},
)
async def remove_node(
    request: Request,
    robot_id: str,
    node: str,
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_within_s: Window = None,
) -> Response:
    """Take the node away from the robot, also where a template brings it."""
    editor = editor_of(request, reason=reason, window=confirm_within_s)
    outcome = await _manager(request).remove(robot_id, node, editor, expected=expected_of(request), dry_run=dry_run)
    return await outcome_answer(request, outcome, dry_run=dry_run)


@router.get(
    "/robots/{robot_id}/nodes/{node}/log",
    dependencies=[require_permission("nodes.read")],
    responses={200: {"model": models.LogPage}, **PROBLEMS},
)
async def read_log(
    request: Request,
    robot_id: str,
    node: str,
    cursor: Cursor = "",
    query: Text = "",
    backwards: Backwards = False,
    max_bytes: PageBytes = LIMITS.node_log_page_bytes,
) -> Response:
    """A page of the node's log, from the robot's disk."""
    page = await services_of(request).nodes.logs.page(
        robot_id, node, cursor=cursor, query=query, backwards=backwards, max_bytes=max_bytes
    )
    return JsonResponse(log_view(page))


@router.get(
    "/robots/{robot_id}/nodes/{node}/log/tail",
    dependencies=[require_permission("nodes.read")],
    response_class=Response,
    responses={200: {"content": {EVENTS: {}}}, **PROBLEMS},
)
async def tail_log(request: Request, robot_id: str, node: str, cursor: Cursor = "", query: Text = "") -> Response:
    """The node's newest lines and those that follow, as server-sent events `lines`; the last event is `end`.

    An event's id is the cursor, so that a browser goes on where it was.
    """
    cursor = request.headers.get("last-event-id", "") or cursor  # a browser that comes back repeats its first cursor
    principal = principal_of(request)
    who = f"{principal.kind}:{principal.id}"
    pages = await services_of(request).nodes.logs.tail(robot_id, node, who=who, cursor=cursor, query=query)
    headers = {"Cache-Control": "no-store", "X-Accel-Buffering": "no"}
    return DownloadResponse(request, _Events(pages), what="a node's log", media_type=EVENTS, headers=headers)


@router.get(
    "/robots/{robot_id}/nodes/{node}/crashes",
    dependencies=[require_permission("nodes.read")],
    responses={200: {"model": models.Crashes}, **PROBLEMS},
)
async def crashes(request: Request, robot_id: str, node: str) -> Response:
    """How the node ended the last times, with its last words; the newest first."""
    found = await services_of(request).nodes.logs.crashes(robot_id, node)
    return JsonResponse({"crashes": [crash_view(item) for item in found]})


@router.post(
    "/robots/{robot_id}/nodes/{node}/{verb}",
    dependencies=[require_permission("nodes.control")],
    responses={200: {"model": models.NodeResult}, **PROBLEMS},
    openapi_extra=body_document(models.VerbForOne),
)
async def act(
    request: Request, robot_id: str, node: str, verb: Verb, dry_run: DryRun = False, reason: Reason = ""
) -> Response:
    """A verb for one node. What `start` and `stop` say lasts: a robot that is offline does it when it is back.

    With the header `Idempotency-Key` the same request of another verb is carried out once.
    """
    body = await read_body(request, models.VerbForOne)
    action = NodeAction(node=node, verb=verb, signal=body.signal)
    nodes, actor, key = services_of(request).nodes, actor_of(request, reason or verb), key_of(request)
    if key is not None and not action.lasts and not dry_run:
        (await nodes.manager.of_robot(robot_id)).get(node)
        await carried_once(request, replace(action.order(robot_id), idempotency=key))
        return JsonResponse(
            result_view(Result(robot=robot_id, action=action, dry_run=False, outcome="done", told=True))
        )
    result = await nodes.verbs.act(robot_id, action, actor, dry_run=dry_run)
    note(request, detail=f"{'dry run: ' if dry_run else ''}{result.outcome}")
    if result.outcome == "failed" and result.error is not None:
        raise result.error
    return JsonResponse(result_view(result))


def actor_of(request: Request, reason: str) -> Actor:
    """Who asks."""
    return Actor(editor=editor_of(request, reason=reason, window=None), principal=principal_of(request))


def _listed(robots: Sequence[RobotNodes], state: str, node: str, limit: int) -> Response:
    """Those of that state and name, as many as may be shown; in a thread, as they may be very many."""
    chosen = (
        node_view(found, in_own=found.name in item.own)
        for item in robots
        for found in item.nodes
        if state in ("", found.state) and node in ("", found.name)
    )
    shown = list(islice(chosen, limit + 1))
    return JsonResponse({"nodes": shown[:limit], "more": len(shown) > limit})


def _manager(request: Request) -> NodeManager:
    return services_of(request).nodes.manager


class _Events:
    """Pages of a log as server-sent events; a comment where nothing came, so that who has gone is noticed."""

    def __init__(self, pages: AsyncGenerator[LogPage, None]) -> None:
        self._pages = pages

    async def pieces(self) -> AsyncIterator[bytes]:
        """Event by event; the last one says why it is the last."""
        end = {"code": "tail_over", "message": "ask again with the last cursor"}
        yield b": the log follows\n\n"
        try:
            async with aclosing(self._pages) as pages:
                async for page in pages:
                    yield _event("lines", log_view(page), page.cursor) if page.lines else b":\n\n"
        except MetarosError as error:
            end = {"code": error_code(error), "message": str(error)}
        yield _event("end", end)

    def close(self) -> None:
        """The pages end with whoever reads them."""


def _event(name: str, data: Mapping[str, Any], cursor: str = "") -> bytes:
    number = f"id: {cursor}\n" if cursor else ""
    return f"event: {name}\n{number}data: ".encode() + orjson.dumps(data) + b"\n\n"
