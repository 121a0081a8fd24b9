"""Rules: what there is, how it changes, and what a rule would have done."""

from __future__ import annotations

import asyncio
import re
from typing import Annotated, Any

from fastapi import Query
from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note
from gateway.api.models import rules as models
from gateway.api.models.identity import Nothing
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.fleet.twin import PRECONDITIONS
from gateway.api.rest.ranges import parse_range
from gateway.api.rule_scope import check_targets, seen_rule, sees_rule
from gateway.api.services import services_of
from gateway.api.views.robots import rfc3339
from gateway.api.views.rules import dry_run_view, entry_view, rule_view, schedule_view
from gateway.automation.rules.document import read_stored
from gateway.automation.rules.errors import RuleInvalidError, UnknownTargetError
from gateway.automation.rules.rule import Rule
from gateway.automation.rules.secrets import target_owner
from gateway.domain.automation.rule import Maker, StoredRule
from gateway.errors import InvalidRequestError
from gateway.identity.permissions import permission
from metaros.automation.rules.schedule import Schedule

__all__ = ["router"]

_ETAG = re.compile(r'(?:W/)?"(\d{1,16})"')
WRITE = "rules.write"
Text = Annotated[str, Query(max_length=128, description="only rules with this in their name or description")]
Count = Annotated[int, Query(ge=1, le=100)]
Before = Annotated[int | None, Query(ge=0, description="the `next` of the page before")]

router = api_router("/api/v1", tags=["rules"])


@router.get("/rules", dependencies=[require_permission("rules.read")], responses={200: {"model": models.RuleList}})
async def list_rules(request: Request, window: Paged, q: Text = "") -> Response:
    """Every rule that reaches no robot out of one's scope, by name."""
    registry, principal = services_of(request).rules.registry, principal_of(request)
    found = [one for one in registry.stored() if sees_rule(principal, one) and q in one.document]
    views = await _views(request, found)
    return listing(
        "rules", found, lambda one: views[one.name], model=models.Rule, key=lambda one: one.name, window=window
    )


@router.get(
    "/rules/{name}",
    dependencies=[require_permission("rules.read")],
    responses={200: {"model": models.Rule}, **PROBLEMS},
)
async def get_rule(request: Request, name: str) -> Response:
    """One rule."""
    return await _answer(request, seen_rule(request, name))


@router.put(
    "/rules/{name}",
    dependencies=[require_permission(WRITE)],
    responses={200: {"model": models.Rule}, 201: {"model": models.Rule}, **PRECONDITIONS},
    openapi_extra=body_document(models.RuleDocument),
)
async def put_rule(request: Request, name: str) -> Response:
    """Add a rule, or put another in its place: it is its maker's from then on. If-Match "0" adds only."""
    body = await read_body(request, models.RuleDocument)
    if body.name != name:
        raise RuleInvalidError("name", f"the path says {name[:64]!r}")
    registry, principal = services_of(request).rules.registry, principal_of(request)
    maker, document = Maker.of(principal), body.model_dump(exclude_unset=True)
    if name in {one.name for one in registry.stored()}:
        seen_rule(request, name)
    check_targets(principal, await asyncio.to_thread(registry.check, document, maker))
    stored, new = await registry.put(document, maker=maker, expected=_expected(request))
    note(request, detail=f"{stored.name} {'created' if new else 'changed'}, revision {stored.revision}")
    return await _answer(request, stored, status=201 if new else 200)


@router.patch(
    "/rules/{name}",
    dependencies=[require_permission(WRITE)],
    responses={200: {"model": models.Rule}, **PRECONDITIONS},
    openapi_extra=body_document(models.RulePatch),
)
async def patch_rule(request: Request, name: str) -> Response:
    """Change some of a rule's fields (JSON Merge Patch): it is its changer's from then on."""
    body = await read_body(request, models.RulePatch)
    seen_rule(request, name)
    registry, principal = services_of(request).rules.registry, principal_of(request)
    maker = Maker.of(principal)
    patch = body.model_dump()
    check_targets(principal, await asyncio.to_thread(registry.merged, name, patch, maker))
    stored = await registry.merge(name, patch, maker=maker, expected=_expected(request))
    note(request, detail=f"{stored.name} changed, revision {stored.revision}")
    return await _answer(request, stored)


@router.delete("/rules/{name}", dependencies=[require_permission(WRITE)], status_code=204, responses=PRECONDITIONS)
async def delete_rule(request: Request, name: str) -> Response:
    """Take a rule away. What it set off is delivered all the same."""
    seen_rule(request, name)
    principal = principal_of(request)
    await services_of(request).rules.registry.remove(name, by=principal.name, expected=_expected(request))
    note(request, detail=name)
    return Response(status_code=204)


@router.post(
    "/rules/{name}/enable",
    dependencies=[require_permission(WRITE)],
    responses={200: {"model": models.Rule}, **PROBLEMS},
    openapi_extra=body_document(Nothing),
)
async def enable_rule(request: Request, name: str) -> Response:
    """Turn a rule on; it stays its maker's."""
    await read_body(request, Nothing)
    return await _turn(request, name, True)


@router.post(
    "/rules/{name}/disable",
    dependencies=[require_permission(WRITE)],
    responses={200: {"model": models.Rule}, **PROBLEMS},
    openapi_extra=body_document(Nothing),
)
async def disable_rule(request: Request, name: str) -> Response:
    """Turn a rule off: it forgets what it waits for."""
    await read_body(request, Nothing)
    return await _turn(request, name, False)


@router.get(
    "/rules/{name}/history",
    dependencies=[require_permission("rules.read")],
    responses={200: {"model": models.RuleHistory}, **PROBLEMS},
)
async def get_rule_history(request: Request, name: str, limit: Count = 20, before: Before = None) -> Response:
    """Who changed a rule, and how, the newest first."""
    seen_rule(request, name)
    entries = await services_of(request).rules.registry.history(name, limit=limit + 1, before=before)
    whole = _whole(request)
    following = entries[limit - 1].revision if len(entries) > limit else None
    return JsonResponse({"entries": [entry_view(one, whole=whole) for one in entries[:limit]], "next": following})


@router.post(
    "/rules/{name}/targets/{target}/secret",
    dependencies=[require_permission(WRITE)],
    responses={200: {"model": models.HookSecret}, **PROBLEMS},
    openapi_extra=body_document(Nothing),
)
async def make_target_secret(request: Request, name: str, target: str) -> Response:
    """A new secret that signs what a webhook's target sends, in place of the one before; shown this once."""
    await read_body(request, Nothing)
    rule = read_stored(seen_rule(request, name))
    if target not in [one.id for one in rule.targets if one.kind == "webhook"]:
        raise UnknownTargetError(f"rule {name} has no webhook {target[:64]!r}")
    secret = await services_of(request).rules.secrets.make(target_owner(name, target))
    note(request, detail=f"{name}/{target}")
    return JsonResponse({"secret": secret}, headers={"Cache-Control": "no-store"})


@router.post(
    "/rules/check",
    dependencies=[require_permission("rules.read")],
    responses={200: {"model": models.RuleChecked}, **PROBLEMS},
    openapi_extra=body_document(models.RulePatch),
)
async def check_rule(request: Request) -> Response:
    """Whether a document can be a rule, and else what is wrong with it; nothing is stored."""
    body = await read_body(request, models.RulePatch)
    maker = Maker.of(principal_of(request))
    try:
        await asyncio.to_thread(services_of(request).rules.registry.check, body.model_dump(), maker)
    except RuleInvalidError as error:
        return JsonResponse({"ok": False, "faults": [{"path": error.path, "message": error.fault}]})
    return JsonResponse({"ok": True, "faults": []})


@router.post(
    "/rules/dry-run",
    dependencies=[require_permission("rules.read")],
    responses={200: {"model": models.DryRunResult}, **PROBLEMS},
    openapi_extra=body_document(models.DryRunRequest),
)
async def dry_run(request: Request) -> Response:
    """What a rule would have done in a time that is stored. It knows of robots in one's own scope, and does nothing."""
    body = await read_body(request, models.DryRunRequest)
    services = services_of(request)
    rule = await _tried(request, body)
    from_ns, until_ns = parse_range(body.from_, body.until, now_ns=services.clock.wall_ns())
    done = await services.rules.dry_runs.run(rule, from_ns=from_ns, until_ns=until_ns, most_firings=body.limit)
    return JsonResponse(await asyncio.to_thread(dry_run_view, done))


@router.get(
    "/schedules", dependencies=[require_permission("rules.read")], responses={200: {"model": models.ScheduleList}}
)
async def list_schedules(request: Request, window: Paged) -> Response:
    """When rules fire by themselves."""
    rules, principal = services_of(request).rules, principal_of(request)
    seen = {one.name for one in rules.registry.stored() if sees_rule(principal, one)}
    found = [rule for rule in rules.registry.rules() if rule.schedule is not None and rule.name in seen]
    fires = await rules.scheduler.next_fires()
    return listing(
        "schedules",
        found,
        lambda rule: schedule_view(rule, fires.get(rule.name)),
        model=models.Schedule,
        key=lambda rule: rule.name,
        window=window,
    )


@router.post(
    "/schedules/preview",
    dependencies=[require_permission("rules.read")],
    responses={200: {"model": models.ScheduleTimes}, **PROBLEMS},
    openapi_extra=body_document(models.SchedulePreview),
)
async def preview_schedule(request: Request) -> Response:
    """The next times of a schedule that somebody thinks of."""
    body = await read_body(request, models.SchedulePreview)
    now_ns = services_of(request).clock.wall_ns()

    def times() -> list[str]:
        schedule = Schedule.parse(body.expression, body.timezone)
        found: list[int] = []
        at_ns = schedule.next_after(now_ns)
        while at_ns is not None and len(found) < body.count:
            found.append(at_ns)
            at_ns = schedule.next_after(at_ns)
        return [rfc3339(one) for one in found]

    return JsonResponse({"times": await asyncio.to_thread(times)})


async def _tried(request: Request, body: models.DryRunRequest) -> Rule:
    """The rule of a dry run, in the scope of who asks."""
    if bool(body.name) == (body.rule is not None):
        raise InvalidRequestError("a dry run is of a name, or of a rule's document")
    maker = Maker.of(principal_of(request))
    if body.rule is not None:
        return await asyncio.to_thread(services_of(request).rules.registry.check, body.rule, maker)
    return await asyncio.to_thread(
        services_of(request).rules.registry.merged, seen_rule(request, body.name).name, {}, maker
    )


async def _turn(request: Request, name: str, enabled: bool) -> Response:
    seen_rule(request, name)
    by = principal_of(request).name
    stored = await services_of(request).rules.registry.enable(name, enabled, by=by)
    note(request, detail=f"{name} {'enabled' if enabled else 'disabled'}")
    return await _answer(request, stored)


async def _answer(request: Request, stored: StoredRule, *, status: int = 200) -> Response:
    views = await _views(request, [stored])
    return JsonResponse(views[stored.name], status_code=status, headers={"ETag": f'"{stored.revision}"'})


async def _views(request: Request, found: list[StoredRule]) -> dict[str, dict[str, Any]]:
    rules, whole = services_of(request).rules, _whole(request)
    stats = await rules.registry.stats([one.name for one in found])
    fires = await rules.scheduler.next_fires()
    return {one.name: rule_view(one, *stats[one.name], fires.get(one.name), whole=whole) for one in found}


def _whole(request: Request) -> bool:
    """Whether somebody may see all of a rule: who may change it."""
    return permission(WRITE).granted(principal_of(request))


def _expected(request: Request) -> int | None:
    said = request.headers.get("if-match", "").strip()
    if said in ("", "*"):
        return None
    found = _ETAG.fullmatch(said)
    if found is None:
        raise InvalidRequestError('If-Match is one ETag, as "7"')
    return int(found[1])
