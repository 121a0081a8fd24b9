"""Templates: parts of twins' documents for all robots that a selector names."""

from __future__ import annotations

import asyncio
import re

from starlette.requests import Request
from starlette.responses import Response

from gateway.api.authorization import require_all_robots, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import Paged, listing
from gateway.api.middleware.audited import note
from gateway.api.models import twin as models
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.fleet.twin import PRECONDITIONS, Count, DryRun, Reason, Window, editor_of
from gateway.api.services import services_of
from gateway.api.views.twin import outcomes_view, template_history_view, template_view
from gateway.domain.fleet.twin import Template
from gateway.errors import InvalidRequestError
from gateway.fleet.twins.plan import Outcome
from metaros.fleet.twin import read

__all__ = ["router"]

_ETAG = re.compile(r'(?:W/)?"(\d{1,16})"')

router = api_router("/api/v1/templates", tags=["twins"])


@router.get("", dependencies=[require_permission("twin.read")], responses={200: {"model": models.TemplateList}})
async def list_templates(request: Request, window: Paged) -> Response:
    """Every template, in the order in which they are laid over each other."""
    found = await services_of(request).twins.templates.all()
    return listing("templates", found, template_view, model=models.Template, key=lambda item: item.name, window=window)


@router.get(
    "/{name}",
    dependencies=[require_permission("twin.read")],
    responses={200: {"model": models.Template}, **PRECONDITIONS},
)
async def get_template(request: Request, name: str) -> Response:
    """One template."""
    item = await services_of(request).twins.templates.get(name)
    return JsonResponse(template_view(item), headers={"ETag": f'"{item.revision}"'})


@router.put(
    "/{name}",
    dependencies=[require_permission("templates.write")],
    responses={200: {"model": models.TemplateChange}, **PRECONDITIONS},
    openapi_extra=body_document(models.TemplateRequest),
)
async def put_template(
    request: Request, name: str, dry_run: DryRun = False, reason: Reason = "", confirm_within_s: Window = None
) -> Response:
    """Add a template, or put another in its place; with what becomes of every robot that it changes."""
    require_all_robots(request, "templates")
    await asyncio.to_thread(read, await request.body())  # no key twice, no NaN, not too deep
    body = await read_body(request, models.TemplateRequest)
    item, outcomes = await services_of(request).twins.templates.put(
        name,
        selector=body.selector,
        document=body.document,
        priority=body.priority,
        editor=editor_of(request, reason=reason, window=confirm_within_s),
        expected=_expected(request),
        dry_run=dry_run,
    )
    return await _answer(request, item, outcomes, dry_run=dry_run)


@router.delete(
    "/{name}",
    dependencies=[require_permission("templates.write")],
    responses={200: {"model": models.TemplateChange}, **PRECONDITIONS},
)
async def delete_template(
    request: Request, name: str, dry_run: DryRun = False, reason: Reason = "", confirm_within_s: Window = None
) -> Response:
    """Take a template away; robots go on with what is left."""
    require_all_robots(request, "templates")
    item, outcomes = await services_of(request).twins.templates.remove(
        name,
        editor=editor_of(request, reason=reason, window=confirm_within_s),
        expected=_expected(request),
        dry_run=dry_run,
    )
    return await _answer(request, item, outcomes, dry_run=dry_run)


@router.get(
    "/{name}/history",
    dependencies=[require_permission("twin.read")],
    responses={200: {"model": models.TemplateHistory}, **PROBLEMS},
)
async def get_template_history(request: Request, name: str, limit: Count = 20) -> Response:
    """Who changed a template, when and why, also of one that is gone; the newest first."""
    entries = await services_of(request).twins.templates.history(name, limit=limit + 1)
    return JsonResponse(await asyncio.to_thread(template_history_view, entries, limit=limit))


@router.post(
    "/{name}/revert",
    dependencies=[require_permission("templates.write")],
    responses={200: {"model": models.TemplateChange}, **PRECONDITIONS},
    openapi_extra=body_document(models.Revert),
)
async def revert_template(
    request: Request, name: str, dry_run: DryRun = False, reason: Reason = "", confirm_within_s: Window = None
) -> Response:
    """The template as it was at an earlier revision, also of one that is gone; with what becomes of each robot."""
    require_all_robots(request, "templates")
    body = await read_body(request, models.Revert)
    item, outcomes = await services_of(request).twins.templates.revert(
        name,
        body.revision,
        editor=editor_of(request, reason=reason or f"back to revision {body.revision}", window=confirm_within_s),
        expected=_expected(request),
        dry_run=dry_run,
    )
    return await _answer(request, item, outcomes, dry_run=dry_run)


async def _answer(request: Request, item: Template, outcomes: list[Outcome], *, dry_run: bool) -> Response:
    view = await asyncio.to_thread(outcomes_view, outcomes, dry_run=dry_run)
    note(request, detail=f"{'dry run: ' if dry_run else ''}{view['changed']} robots of {item.selector.text or 'all'}")
    return JsonResponse({**view, "template": template_view(item)}, headers={"ETag": f'"{item.revision}"'})


def _expected(request: Request) -> int | None:
    said = request.headers.get("if-match", "").strip()
    if said in ("", "*"):
        return None
    found = _ETAG.fullmatch(said)
    if found is None:
        raise InvalidRequestError('If-Match is one ETag, as "7"')
    return int(found[1])
