"""Groups of robots by their labels, and what a robot says at this moment."""

from __future__ import annotations

import asyncio
from collections import Counter
from typing import Annotated, Any

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note
from gateway.api.models import fleet, twin
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.fleet.twin import DryRun, Reason, Select, editor_of
from gateway.api.rest.ranges import Topics, chosen_topics
from gateway.api.services import services_of
from gateway.api.snapshot import collect_live, newest_stored
from gateway.api.views.robots import rfc3339
from gateway.api.views.twin import outcomes_view
from gateway.domain.fleet.selector import Selector, check_labels
from gateway.fleet.twins.plan import Edit

__all__ = ["router"]

MAX_WAIT_S = 10.0
LOOKED_AT_ONCE = 500  # robots that are counted before others get to do something

router = api_router("/api/v1", tags=["robots"])


@router.get("/groups", dependencies=[require_permission("robots.read")], responses={200: {"model": fleet.GroupList}})
async def list_groups(
    request: Request,
    window: Paged,
    label: Annotated[str, Query(max_length=128, description="only the values of this label")] = "",
) -> Response:
    """The values of robots' labels, and how many robots have each."""
    services, principal = services_of(request), principal_of(request)
    robots: Counter[tuple[str, str]] = Counter()
    online: Counter[tuple[str, str]] = Counter()
    for place, record in enumerate(services.registry.all(), 1):
        if principal.sees(record.robot.id):
            pairs = services.twins.labels_of(record.robot.id).items()
            chosen = [pair for pair in pairs if not label or pair[0] == label]
            robots.update(chosen)
            if record.online:
                online.update(chosen)
        if place % LOOKED_AT_ONCE == 0:
            await asyncio.sleep(0)

    def view(pair: tuple[str, str]) -> dict[str, Any]:
        name, value = pair
        counts = {"robots": robots[pair], "online": online[pair]}
        return {"label": name, "value": value, "selector": f"{name}={value}" if value else name, **counts}

    return listing("groups", sorted(robots), view, model=fleet.Group, key="=".join, window=window)


@router.patch(
    "/groups",
    dependencies=[require_permission("twin.write")],
    responses={200: {"model": twin.TwinsChange}, **PROBLEMS},
    openapi_extra=body_document(twin.LabelsChange),
)
async def label_group(request: Request, selector: Select, dry_run: DryRun = False, reason: Reason = "") -> Response:
    """Give every robot that the selector names labels; null takes one away. All of them, or none."""
    body = await read_body(request, twin.LabelsChange)
    wanted = Selector.parse(selector)
    check_labels(body.labels)
    editor = editor_of(request, reason=reason or "labels", window=None)
    outcomes = await services_of(request).twins.manager.edit_many(
        wanted, Edit(labels=body.labels), editor, sees=principal_of(request).sees, dry_run=dry_run
    )
    view = await asyncio.to_thread(outcomes_view, outcomes, dry_run=dry_run)
    note(request, detail=f"{'dry run: ' if dry_run else ''}labels of {len(outcomes)} robots: {wanted.text or 'all'}")
    return JsonResponse(view)


@router.get(
    "/robots/{robot_id}/snapshot",
    dependencies=[require_permission("telemetry.read")],
    responses={200: {"model": fleet.Snapshot}, **PROBLEMS},
)
async def get_snapshot(
    request: Request,
    robot_id: str,
    topic: Topics = None,
    wait_s: Annotated[float, Query(ge=0, le=MAX_WAIT_S, description="for messages of live topics")] = 1.0,
) -> Response:
    """The newest message of each topic, as it comes within a moment or else is stored, and the newest metrics."""
    services = services_of(request)
    record = services.registry.get(robot_id)
    names = [state.channel.topic for state in record.topics()]
    topics = chosen_topics(names, topic, namespace=record.robot.namespace)
    found = await collect_live(services.hub, record, topics, wait_s=wait_s)
    now_ns = services.clock.wall_ns()
    rest = [name for name in topics if name not in found]
    found |= await newest_stored(services.history, robot_id, rest, now_ns=now_ns)
    values = record.newest().items()
    view = {
        "robot": robot_id,
        "time": rfc3339(now_ns),
        "online": record.online,
        "topics": [found[name] for name in topics if name in found],
        "missing": [name for name in topics if name not in found],
        "metrics": {name: {"stamp_ms": stamp / 1e6, "value": value} for name, (stamp, value) in values},
    }
    return JsonResponse(view)
