"""Rollouts: start, watch, pause, resume and end them."""

from __future__ import annotations

from typing import Any, get_args

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note
from gateway.api.models import common, rollouts
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.once import once_of
from gateway.api.services import services_of
from gateway.api.views.robots import rfc3339
from gateway.domain.fleet.rollout import IN_FLIGHT, MemberState, Plan, Rollout
from gateway.fleet.rollouts.errors import UnknownRolloutError
from metaros.fleet.bundle import AGENT, version_key

__all__ = ["rollout_view", "router"]

ANSWERS: dict[int | str, dict[str, Any]] = {200: {"model": rollouts.Rollout}, **PROBLEMS}

router = api_router("/api/v1/rollouts", tags=["updates"])


@router.get("", dependencies=[require_permission("updates.read")], responses={200: {"model": rollouts.RolloutList}})
async def list_rollouts(request: Request, window: Paged) -> Response:
    """The newest rollouts that have a robot in one's scope, the newest first."""
    found = [one for one in await services_of(request).rollouts.list() if _sees(request, one)]
    return listing("rollouts", found, rollout_view, model=rollouts.Rollout, key=lambda one: one.id, window=window)


@router.post(
    "",
    status_code=201,
    dependencies=[require_permission("rollouts.manage")],
    responses={
        201: {"model": rollouts.RolloutDetail},
        200: {"model": rollouts.RolloutDetail},
        **PROBLEMS,
    },
    openapi_extra=body_document(rollouts.RolloutRequest),
)
async def start_rollout(request: Request) -> Response:
    """Start a rollout to every robot in scope that the selector names; 200 and nothing done for a dry run.

    With the header `Idempotency-Key` the same request starts one, and is answered with how that stands now.
    """
    body = await read_body(request, rollouts.RolloutRequest)
    version_key(body.version)
    plan = Plan(
        kind="node" if body.node else "agent",
        node=body.node,
        bundle=(body.bundle or body.node) if body.node else AGENT,
        version=body.version,
        selector=body.selector,
        waves=tuple(body.waves),
        max_failure_rate=body.max_failure_rate,
        health_s=body.health_s,
        steady_s=body.steady_s,
        offline_s=body.offline_s,
        give_up_s=body.give_up_s,
    )
    principal = principal_of(request)
    made = await services_of(request).rollouts.start(
        plan,
        by=principal.name,
        sees=principal.sees,
        dry_run=body.dry_run,
        once=once_of(request, {"rollout": body.model_dump()}),
    )
    note(request, detail=f"{'dry run of ' if body.dry_run else ''}{made.id}: {plan.bundle} {plan.version}")
    view = _seen(request, made, dry_run=body.dry_run)
    return JsonResponse(view, status_code=200 if body.dry_run else 201)


@router.get(
    "/{rollout_id}",
    dependencies=[require_permission("updates.read")],
    responses={200: {"model": rollouts.RolloutDetail}, 404: {"model": common.Problem}},
)
async def get_rollout(request: Request, rollout_id: str) -> Response:
    """One rollout, with those of its robots that are in one's scope."""
    return JsonResponse(_seen(request, await _get(request, rollout_id)))


@router.post(
    "/{rollout_id}/pause",
    dependencies=[require_permission("rollouts.manage")],
    responses=ANSWERS,
    openapi_extra=body_document(rollouts.Why),
)
async def pause_rollout(request: Request, rollout_id: str) -> Response:
    """Tell no further robot; those at it go on."""
    body = await read_body(request, rollouts.Why)
    await _get(request, rollout_id, whole=True)
    return JsonResponse(rollout_view(await services_of(request).rollouts.pause(rollout_id, body.reason)))


@router.post(
    "/{rollout_id}/resume",
    dependencies=[require_permission("rollouts.manage")],
    responses=ANSWERS,
    openapi_extra=body_document(rollouts.Resume),
)
async def resume_rollout(request: Request, rollout_id: str) -> Response:
    """Go on in spite of the failures so far; or with another version, from the first wave and for every robot."""
    body = await read_body(request, rollouts.Resume)
    if body.version:
        version_key(body.version)
    await _get(request, rollout_id, whole=True)
    return JsonResponse(rollout_view(await services_of(request).rollouts.resume(rollout_id, version=body.version)))


@router.post(
    "/{rollout_id}/abort",
    dependencies=[require_permission("rollouts.manage")],
    responses=ANSWERS,
    openapi_extra=body_document(rollouts.Why),
)
async def abort_rollout(request: Request, rollout_id: str) -> Response:
    """End it. Robots that were told keep what their twins say."""
    body = await read_body(request, rollouts.Why)
    await _get(request, rollout_id, whole=True)
    return JsonResponse(rollout_view(await services_of(request).rollouts.abort(rollout_id, body.reason)))


def rollout_view(one: Rollout, *, members: bool = False, dry_run: bool = False) -> dict[str, Any]:
    """A rollout as the API shows it."""
    plan = one.plan
    view: dict[str, Any] = {
        "id": one.id,
        "state": one.state,
        "reason": one.reason,
        "kind": plan.kind,
        "node": plan.node,
        "bundle": plan.bundle,
        "version": plan.version,
        "selector": plan.selector,
        "max_failure_rate": plan.max_failure_rate,
        "health_s": plan.health_s,
        "steady_s": plan.steady_s,
        "offline_s": plan.offline_s,
        "give_up_s": plan.give_up_s,
        "robots": len(one.members),
        "wave": one.wave,
        "waves": [
            {
                "wave": wave,
                "size": size,
                "in_flight": one.count(*IN_FLIGHT, wave=wave),
                "done": one.count("done", wave=wave),
                "failed": one.count("failed", wave=wave),
            }
            for wave, size in enumerate(one.sizes, 1)
        ],
        "counts": {state: one.count(state) for state in get_args(MemberState)},
        "created": rfc3339(one.created_ns),
        "created_by": one.created_by,
        "changed": rfc3339(one.changed_ns),
        "dry_run": dry_run,
    }
    if members:
        view["members"] = [
            {
                "robot": member.robot,
                "state": member.state,
                "wave": member.wave,
                "since": rfc3339(member.since_ns),
                "reason": member.reason,
            }
            for member in sorted(one.members.values(), key=lambda item: item.place)
        ]
    return view


async def _get(request: Request, rollout_id: str, *, whole: bool = False) -> Rollout:
    """One rollout; UnknownRolloutError also where none of its robots is in scope, or `whole` and not all of them."""
    one = await services_of(request).rollouts.get(rollout_id)
    if not _sees(request, one, whole=whole):
        raise UnknownRolloutError(f"there is no rollout {rollout_id[:40]!r}")
    return one


def _seen(request: Request, one: Rollout, *, dry_run: bool = False) -> dict[str, Any]:
    """A rollout with those of its robots that are in one's scope."""
    view = rollout_view(one, members=True, dry_run=dry_run)
    view["members"] = [item for item in view["members"] if principal_of(request).sees(item["robot"])]
    return view


def _sees(request: Request, one: Rollout, *, whole: bool = False) -> bool:
    principal = principal_of(request)
    if principal.sees_all:
        return True
    return (all if whole else any)(principal.sees(robot) for robot in one.members)
