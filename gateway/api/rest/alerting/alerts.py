"""Alerts: what is wrong, and what people do about it. Of robots out of one's scope there are none."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Annotated, Any

from fastapi import Query
from pydantic import Field
from starlette.requests import Request
from starlette.responses import Response

from gateway.alerting.alerts.errors import UnknownAlertError
from gateway.api.authorization import principal_of, require_permission
from gateway.api.lazy_route import api_router
from gateway.api.listing import FieldsText, read_fields
from gateway.api.middleware.audited import note
from gateway.api.models import alerts, common, identity
from gateway.api.models.recordings import Recording
from gateway.api.problem import JsonResponse
from gateway.api.rest.bodies import PROBLEMS, body_document, read_body
from gateway.api.rest.history.recordings import recording_view
from gateway.api.rest.once import once_of
from gateway.api.rest.times import parse_time
from gateway.api.services import services_of
from gateway.api.silence_scope import check_silence_scope
from gateway.api.views.alerts import alert_detail_view, alert_view, counts_view, silence_view
from gateway.domain.alert import Alert, AlertFilter
from gateway.domain.fleet import recording as recordings
from gateway.errors import UnknownRecordingError

__all__ = ["router", "seen_alert", "seer"]

MAX_LISTED = 1000
Robots = Annotated[
    list[Annotated[str, Field(max_length=64)]] | None, Query(max_length=256, description="only these robots'")
]
Causes = Annotated[
    list[Annotated[str, Field(max_length=128)]] | None,
    Query(max_length=32, description="only of these causes, or patterns of them: rate:*"),
]
States = Annotated[list[alerts.AlertState] | None, Query(max_length=3, description="only those in one of them")]
Severities = Annotated[list[alerts.Severity] | None, Query(max_length=3, description="only those as bad")]
Text = Annotated[str, Query(max_length=200, description="part of the title, the reason, the robot or the cause")]
From = Annotated[str, Query(alias="from", max_length=64, description="not resolved before: RFC 3339, or like -1h")]
Until = Annotated[str, Query(max_length=64, description="opened before: RFC 3339, relative, or now")]
Quiet = Annotated[bool | None, Query(description="only those that nobody is told of, or only the others")]
Before = Annotated[str, Query(max_length=64, description="the `next` of the page before")]
ANSWERS: dict[int | str, dict[str, Any]] = {200: {"model": alerts.Alert}, **PROBLEMS}

router = api_router("/api/v1/alerts", tags=["alerts"])


@router.get("", dependencies=[require_permission("alerts.read")], responses={200: {"model": alerts.AlertList}})
async def list_alerts(
    request: Request,
    state: States = None,
    severity: Severities = None,
    robot: Robots = None,
    cause: Causes = None,
    q: Text = "",
    from_: From = "",
    until: Until = "",
    quiet: Quiet = None,
    limit: Annotated[int, Query(ge=1, le=MAX_LISTED)] = 100,
    before: Before = "",
    fields: FieldsText = "",
) -> Response:
    """The newest alerts, newest first; with `from` and `until` those that were not resolved at some time in between."""
    services, chosen = services_of(request), read_fields(fields, alerts.Alert)
    now_ns = services.clock.wall_ns()
    wanted = AlertFilter(
        states=tuple(state or ()),
        severities=tuple(severity or ()),
        robots=tuple(robot or ()),
        causes=tuple(cause or ()),
        text=q,
        from_ns=parse_time(from_, now_ns=now_ns) if from_ else 0,
        until_ns=parse_time(until, now_ns=now_ns) if until else 0,
        quiet=quiet,
        sees=seer(request),
    )
    found = await services.alerts.list(wanted, limit=limit + 1, before=before or None)
    page = found[:limit]
    following = page[-1].id if len(found) > limit else None

    def answer() -> Response:
        return JsonResponse({"alerts": [chosen.of(alert_view(item)) for item in page], "next": following})

    return await asyncio.to_thread(answer)  # a thousand take longer than others may wait on the event loop


@router.get("/counts", dependencies=[require_permission("alerts.read")], responses={200: {"model": alerts.AlertCounts}})
async def count_alerts(request: Request) -> Response:
    """How many alerts are not resolved."""
    return JsonResponse(counts_view(services_of(request).alerts.counts(seer(request))))


@router.get(
    "/{alert_id}",
    dependencies=[require_permission("alerts.read")],
    responses={200: {"model": alerts.AlertDetail}, 404: {"model": common.Problem}},
)
async def get_alert(request: Request, alert_id: str) -> Response:
    """One alert, with what was found and what was said."""
    return await _detail(request, await seen_alert(request, alert_id))


@router.post(
    "/{alert_id}/acknowledge",
    dependencies=[require_permission("alerts.handle")],
    responses=ANSWERS,
    openapi_extra=body_document(alerts.AlertText),
)
async def acknowledge_alert(request: Request, alert_id: str) -> Response:
    """Somebody sees to it: it is not told again until it gets worse."""
    return await _said(request, alert_id, services_of(request).alerts.acknowledge)


@router.post(
    "/{alert_id}/unacknowledge",
    dependencies=[require_permission("alerts.handle")],
    responses=ANSWERS,
    openapi_extra=body_document(alerts.AlertText),
)
async def unacknowledge_alert(request: Request, alert_id: str) -> Response:
    """Nobody sees to it after all."""
    return await _said(request, alert_id, services_of(request).alerts.unacknowledge)


@router.post(
    "/{alert_id}/resolve",
    dependencies=[require_permission("alerts.handle")],
    responses=ANSWERS,
    openapi_extra=body_document(alerts.AlertText),
)
async def resolve_alert(request: Request, alert_id: str) -> Response:
    """It is over, whatever is found; what is found anew is another alert, or this one again within its cool-down."""
    return await _said(request, alert_id, services_of(request).alerts.resolve)


@router.post(
    "/{alert_id}/comments",
    status_code=201,
    dependencies=[require_permission("alerts.handle")],
    responses={201: {"model": alerts.AlertDetail}, **PROBLEMS},
    openapi_extra=body_document(alerts.AlertComment),
)
async def comment_alert(request: Request, alert_id: str) -> Response:
    """Say something to it. With an `Idempotency-Key` the same request says it once."""
    body = await read_body(request, alerts.AlertComment)
    found = await seen_alert(request, alert_id)
    once = once_of(request, {"alert": found.id, "text": body.text})
    by = principal_of(request).name
    said = await services_of(request).alerts.comment(found.id, text=body.text, by=by, once=once)
    note(request, detail=_named(said))
    return await _detail(request, said, status_code=201)


@router.post(
    "/{alert_id}/assign",
    dependencies=[require_permission("alerts.handle")],
    responses=ANSWERS,
    openapi_extra=body_document(alerts.AlertAssign),
)
async def assign_alert(request: Request, alert_id: str) -> Response:
    """Say who sees to it; "" is nobody."""
    body = await read_body(request, alerts.AlertAssign)
    found = await seen_alert(request, alert_id)
    by = principal_of(request).name
    changed = await services_of(request).alerts.assign(found.id, assignee=body.assignee, by=by)
    note(request, detail=f"{_named(changed)} to {body.assignee or 'nobody'}")
    return JsonResponse(alert_view(changed))


@router.post(
    "/{alert_id}/normal",
    dependencies=[require_permission("alerts.handle")],
    responses={200: {"model": alerts.AlertNormal}, **PROBLEMS},
    openapi_extra=body_document(alerts.AlertText),
)
async def accept_alert(request: Request, alert_id: str) -> Response:
    """What was found is normal: teach it to whatever found it."""
    body = await read_body(request, alerts.AlertText)
    services, found = services_of(request), await seen_alert(request, alert_id)
    taught = await services.watch.normal(found)
    changed = await services.alerts.normal(found.id, text=body.text, by=principal_of(request).name)
    note(request, detail=f"{_named(changed)}: {len(taught)} taught")
    return JsonResponse({"alert": alert_view(changed), "taught": taught})


@router.post(
    "/{alert_id}/silence",
    status_code=201,
    dependencies=[require_permission("alerts.handle")],
    responses={201: {"model": alerts.Silence}, **PROBLEMS},
    openapi_extra=body_document(alerts.AlertSilence),
)
async def silence_alert(request: Request, alert_id: str) -> Response:
    """Tell nobody of the robot's alerts of this cause for a while. With an `Idempotency-Key` it begins once."""
    body = await read_body(request, alerts.AlertSilence)
    services, found = services_of(request), await seen_alert(request, alert_id)
    robots = (found.robot,) if found.robot else ()
    principal = principal_of(request)
    check_silence_scope(principal, robots)
    made = await services.alerts.add_silence(
        robots=robots,
        causes=(found.cause,),
        until_ns=services.clock.wall_ns() + round(body.for_s * 1e9),
        reason=body.reason,
        by=principal.name,
        once=once_of(request, {"alert": found.id, **body.model_dump()}),
    )
    note(request, detail=f"{_named(found)}: {made.id} for {body.for_s:g} s")
    return JsonResponse(silence_view(made), status_code=201)


@router.post(
    "/{alert_id}/clip",
    status_code=202,
    dependencies=[require_permission("alerts.handle")],
    responses={202: {"model": Recording}, **PROBLEMS},
    openapi_extra=body_document(identity.Nothing),
)
async def clip_alert(request: Request, alert_id: str) -> Response:
    """Ask the robot's black box for what it has around the alert's beginning; one clip that is on its way is enough."""
    await read_body(request, identity.Nothing)
    services, found = services_of(request), await seen_alert(request, alert_id)
    asked = await _clip_of(request, found) or await services.watch.clip(found)
    note(request, detail=f"{_named(found)}: recording {asked.id}")
    headers = {"location": f"/api/v1/recordings/{asked.id}"}
    return JsonResponse(recording_view(asked), status_code=202, headers=headers)


def seer(request: Request) -> Callable[[str], bool] | None:
    """Which robots' alerts somebody may know of; None: all, the fleet's own too."""
    principal = principal_of(request)
    return None if principal.sees_all else lambda robot: bool(robot) and principal.sees(robot)


async def seen_alert(request: Request, alert_id: str) -> Alert:
    """One alert; UnknownAlertError also where its robot is out of scope."""
    found = await services_of(request).alerts.get(alert_id)
    sees = seer(request)
    if sees is not None and not sees(found.robot):
        raise UnknownAlertError.of(alert_id)
    return found


async def _said(request: Request, alert_id: str, act: Callable[..., Awaitable[Alert]]) -> Response:
    """Do what needs no more than a text."""
    body = await read_body(request, alerts.AlertText)
    found = await seen_alert(request, alert_id)
    changed = await act(found.id, by=principal_of(request).name, text=body.text)
    note(request, detail=_named(changed))
    return JsonResponse(alert_view(changed))


async def _detail(request: Request, alert: Alert, *, status_code: int = 200) -> Response:
    remarks = await services_of(request).alerts.remarks(alert.id)
    return JsonResponse(alert_detail_view(alert, remarks), status_code=status_code)


async def _clip_of(request: Request, alert: Alert) -> recordings.Recording | None:
    """The recording that the alert has already, unless it failed or is gone."""
    if not alert.clip:
        return None
    try:
        found = await services_of(request).recordings.get(alert.clip)
    except UnknownRecordingError:
        return None
    return None if found.state == recordings.FAILED else found


def _named(alert: Alert) -> str:
    return f"{alert.id} {alert.robot or 'fleet'} {alert.cause}"
