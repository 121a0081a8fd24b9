"""Twins: what robots are to be and what they say they are; edits of one or of many, tried first, taken back."""

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
from gateway.api.models import twin as models
from gateway.api.models.identity import Nothing
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.services import services_of
from gateway.api.views.twin import brief_view, history_view, outcome_view, outcomes_view, twin_view
from gateway.domain.fleet.selector import Selector
from gateway.errors import InvalidRequestError
from gateway.fleet.twins.manager import Editor, TwinState
from gateway.fleet.twins.plan import Edit, Outcome
from gateway.identity.permissions import permission
from metaros.fleet.twin import json_schema, read

__all__ = [
    "ANY_OBJECT",
    "PRECONDITIONS",
    "SELECTOR",
    "Count",
    "DryRun",
    "Reason",
    "Select",
    "Window",
    "document_of",
    "editor_of",
    "expected_of",
    "outcome_answer",
    "router",
]

MIN_CONFIRM_S, MAX_CONFIRM_S = 5.0, 3600.0
_ETAG = re.compile(r'(?:W/)?"(\d{1,16})(?:\.(\d{1,16}))?"')

DryRun = Annotated[bool, Query(description="only say what would change; nothing is stored")]
Reason = Annotated[str, Query(max_length=200, description="why, for the history")]
Window = Annotated[
    float | None,
    Query(ge=MIN_CONFIRM_S, le=MAX_CONFIRM_S, description="robots go back by themselves without a confirmation in it"),
]
SELECTOR = "label=value, label!=value, label in (a, b), label"
Select = Annotated[str, Query(max_length=4096, description=SELECTOR)]
Count = Annotated[int, Query(ge=1, le=100)]
ANY_OBJECT = {"requestBody": {"required": True, "content": {"application/json": {"schema": {"type": "object"}}}}}
PRECONDITIONS: dict[int | str, dict[str, Any]] = {**PROBLEMS, 412: PROBLEMS[409]}

router = api_router("/api/v1", tags=["twins"])


@router.get("/twin/schema", dependencies=[require_permission("twin.read")], response_model=None)
async def schema() -> Response:
    """The desired document as JSON Schema."""
    return JsonResponse(json_schema())


@router.get(
    "/robots/{robot_id}/twin",
    dependencies=[require_permission("twin.read")],
    responses={200: {"model": models.Twin}, **PROBLEMS},
)
async def get_twin(request: Request, robot_id: str) -> Response:
    """What the robot is to be, what it says it is, and the difference. The ETag is for If-Match."""
    state = await services_of(request).twins.manager.state(robot_id)
    view = await asyncio.to_thread(twin_view, state)
    return JsonResponse(view, headers={"ETag": _etag(state)})


@router.put(
    "/robots/{robot_id}/twin",
    dependencies=[require_permission("twin.write")],
    responses={200: {"model": models.TwinChange}, **PRECONDITIONS},
    openapi_extra=ANY_OBJECT,
)
async def put_twin(
    request: Request, robot_id: str, dry_run: DryRun = False, reason: Reason = "", confirm_within_s: Window = None
) -> Response:
    """Another own document; null in it takes away what templates say."""
    edit = Edit(document=await document_of(request))
    return await _edited(request, robot_id, edit, dry_run=dry_run, reason=reason, window=confirm_within_s)


@router.patch(
    "/robots/{robot_id}/twin",
    dependencies=[require_permission("twin.write")],
    responses={200: {"model": models.TwinChange}, **PRECONDITIONS},
    openapi_extra=ANY_OBJECT,
)
async def patch_twin(
    request: Request, robot_id: str, dry_run: DryRun = False, reason: Reason = "", confirm_within_s: Window = None
) -> Response:
    """A JSON merge patch (RFC 7396) of the robot's own document."""
    edit = Edit(patch=await document_of(request))
    return await _edited(request, robot_id, edit, dry_run=dry_run, reason=reason, window=confirm_within_s)


@router.get(
    "/robots/{robot_id}/twin/history",
    dependencies=[require_permission("twin.read")],
    responses={200: {"model": models.TwinHistory}, **PROBLEMS},
)
async def get_history(request: Request, robot_id: str, limit: Count = 20) -> Response:
    """Who changed what, when and why; the newest first, at most 100 are kept."""
    entries = await services_of(request).twins.manager.history(robot_id, limit=limit + 1)
    return JsonResponse(await asyncio.to_thread(history_view, entries, limit=limit))


@router.post(
    "/robots/{robot_id}/twin/revert",
    dependencies=[require_permission("twin.write")],
    responses={200: {"model": models.TwinChange}, **PRECONDITIONS},
    openapi_extra=body_document(models.Revert),
)
async def revert(
    request: Request, robot_id: str, dry_run: DryRun = False, reason: Reason = "", confirm_within_s: Window = None
) -> Response:
    """Give the robot its own document of an earlier revision; templates stay as they are."""
    body = await read_body(request, models.Revert)
    editor = editor_of(request, reason=reason or f"back to revision {body.revision}", window=confirm_within_s)
    manager = services_of(request).twins.manager
    outcome = await manager.revert(robot_id, body.revision, editor, expected=expected_of(request), dry_run=dry_run)
    return await outcome_answer(request, outcome, dry_run=dry_run)


@router.post(
    "/robots/{robot_id}/twin/retry",
    dependencies=[require_permission("twin.write")],
    responses={200: {"model": models.TwinChange}, **PRECONDITIONS},
    openapi_extra=body_document(Nothing),
)
async def retry(request: Request, robot_id: str, reason: Reason = "", confirm_within_s: Window = None) -> Response:
    """The same document under a new revision: for a robot that refused it or went back."""
    await read_body(request, Nothing)
    edit = Edit(again=True)
    return await _edited(request, robot_id, edit, dry_run=False, reason=reason or "again", window=confirm_within_s)


@router.patch(
    "/robots/{robot_id}/labels",
    dependencies=[require_permission("twin.write")],
    responses={200: {"model": models.TwinChange}, **PRECONDITIONS},
    openapi_extra=body_document(models.LabelsChange),
)
async def label(request: Request, robot_id: str, dry_run: DryRun = False, reason: Reason = "") -> Response:
    """Give the robot labels, over those that it says itself; null takes one away. Templates may follow."""
    body = await read_body(request, models.LabelsChange)
    editor = editor_of(request, reason=reason or "labels", window=None)
    manager = services_of(request).twins.manager
    outcome = await manager.edit(
        robot_id, Edit(labels=body.labels), editor, expected=expected_of(request), dry_run=dry_run
    )
    return await outcome_answer(request, outcome, dry_run=dry_run)


@router.get(
    "/twins",
    dependencies=[require_permission("twin.read")],
    responses={200: {"model": models.TwinList}, **PROBLEMS},
)
async def list_twins(request: Request, window: Paged, selector: Select = "") -> Response:
    """Every robot that the selector names and that one sees: whether it lives by what is desired."""
    states = await services_of(request).twins.manager.states(Selector.parse(selector), principal_of(request).sees)
    return await asyncio.to_thread(
        lambda: listing(
            "twins", states, brief_view, model=models.TwinBrief, key=lambda state: state.desired.robot, window=window
        )
    )


@router.patch(
    "/twins",
    dependencies=[require_permission("twin.write")],
    responses={200: {"model": models.TwinsChange}, **PROBLEMS},
    openapi_extra=ANY_OBJECT,
)
async def patch_twins(
    request: Request,
    selector: Select,
    dry_run: DryRun = False,
    reason: Reason = "",
    confirm_within_s: Window = None,
) -> Response:
    """A merge patch of the own documents of every robot that the selector names: all of them, or none."""
    wanted, edit = Selector.parse(selector), Edit(patch=await document_of(request))
    editor = editor_of(request, reason=reason, window=confirm_within_s)
    outcomes = await services_of(request).twins.manager.edit_many(
        wanted, edit, editor, sees=principal_of(request).sees, dry_run=dry_run
    )
    view = await asyncio.to_thread(outcomes_view, outcomes, dry_run=dry_run)
    note(request, detail=f"{'dry run: ' if dry_run else ''}{view['changed']} robots of {wanted.text or 'all'}")
    return JsonResponse(view)


def editor_of(request: Request, *, reason: str, window: float | None) -> Editor:
    """Who asks, as an editor of twins."""
    if "\0" in reason:
        raise InvalidRequestError("reason: text has no NUL")
    principal = principal_of(request)
    code = permission("nodes.code").granted(principal)
    return Editor(name=principal.name or principal.id, reason=reason, code=code, confirm_within_s=window)


async def _edited(
    request: Request, robot_id: str, edit: Edit, *, dry_run: bool, reason: str, window: float | None
) -> Response:
    editor = editor_of(request, reason=reason, window=window)
    manager = services_of(request).twins.manager
    outcome = await manager.edit(robot_id, edit, editor, expected=expected_of(request), dry_run=dry_run)
    return await outcome_answer(request, outcome, dry_run=dry_run)


async def outcome_answer(request: Request, outcome: Outcome, *, dry_run: bool) -> Response:
    """The answer to an edit of one robot's twin."""
    after = outcome.after
    view = await asyncio.to_thread(outcome_view, outcome, dry_run=dry_run)
    note(request, detail=f"{'dry run: ' if dry_run else ''}revision {after.revision}.{after.edition}")
    return JsonResponse(view, headers={"ETag": f'"{after.revision}.{after.edition}"'})


async def document_of(request: Request) -> dict[str, Any]:
    """The body, read as strictly as a twin's document is."""
    if "json" not in request.headers.get("content-type", ""):
        raise InvalidRequestError("this request has a JSON body")
    return await asyncio.to_thread(read, await request.body())


def _etag(state: TwinState) -> str:
    return f'"{state.desired.revision}.{state.desired.edition}"'


def expected_of(request: Request) -> tuple[int, int | None] | None:
    """What If-Match names: a revision, and perhaps an edition of it."""
    said = request.headers.get("if-match", "").strip()
    if said in ("", "*"):
        return None
    found = _ETAG.fullmatch(said)
    if found is None:
        raise InvalidRequestError('If-Match is one ETag, as "7" or "7.12"')
    return int(found[1]), int(found[2]) if found[2] else None
