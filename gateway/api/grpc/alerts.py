"""AlertService: what is wrong, and what people do about it, as in REST; every call is authorized."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import aclosing
from dataclasses import replace
from typing import Any

import orjson

from gateway.alerting.alerts.errors import UnknownAlertError, UnknownSilenceError
from gateway.alerting.backtest import BacktestRequest
from gateway.api.grpc import alert_views as views
from gateway.api.grpc.alert_fields import filter_of, given, read_as, require_all_robots, seen_alert, seer
from gateway.api.grpc.authenticate import Call
from gateway.api.grpc.fields import FieldFaultError, document
from gateway.api.grpc.stream_authorization import ENDING, DrainingError, while_authorized
from gateway.api.models import alerts as models_alerts
from gateway.api.models import watch
from gateway.api.rest.ranges import parse_range
from gateway.api.silence_scope import check_silence_scope, covers, sees_silence
from gateway.api.views.alerts import counts_view
from gateway.domain.alert import Alert, AlertFilter, AlertState
from gateway.domain.automation.event import EventFilter
from gateway.errors import UnknownRecordingError
from metaros._proto import alerts_pb2

__all__ = ["AlertService"]

LISTED, MAX_LISTED = 100, 1000
HOUR_S = 3600.0
EVENT_KINDS = "alert.*"
CHANGES = ("enabled", "low", "high", "for_s", "clear_s", "severity")
UNRESOLVED: tuple[AlertState, ...] = ("open", "acknowledged")


class AlertService:
    """Each method is one call that was let in."""

    async def ListAlerts(self, request: alerts_pb2.ListAlertsRequest, call: Call) -> Any:
        """A page of them, the newest first."""
        limit = request.limit or LISTED
        if limit > MAX_LISTED:
            raise FieldFaultError("limit", f"limit is at most {MAX_LISTED}")
        wanted = filter_of(request.filter, call)
        found = await call.services.alerts.list(wanted, limit=limit + 1, before=request.before or None)
        alerts = await asyncio.to_thread(lambda: [views.alert_message(item) for item in found[:limit]])
        return alerts_pb2.ListAlertsResponse(alerts=alerts, next=found[limit - 1].id if len(found) > limit else "")

    async def CountAlerts(self, request: alerts_pb2.CountAlertsRequest, call: Call) -> Any:
        """How many are not resolved."""
        return alerts_pb2.AlertCounts(**counts_view(call.services.alerts.counts(seer(call.principal))))

    async def GetAlert(self, request: alerts_pb2.GetAlertRequest, call: Call) -> Any:
        """One alert, with what was found and what was said."""
        found = await seen_alert(call, request.alert)
        remarks = await call.services.alerts.remarks(found.id)
        return alerts_pb2.AlertDetail(
            alert=views.alert_message(found),
            findings=[views.evidence_message(item) for item in found.findings],
            remarks=[views.remark_message(item) for item in remarks],
        )

    async def WatchAlerts(self, request: alerts_pb2.WatchAlertsRequest, call: Call) -> AsyncIterator[Any]:
        """Those that are, then each change by any gateway, from the journal; TooManyError without a place."""
        services, wanted = call.services, replace(filter_of(request.filter, call), states=(), from_ns=0, until_ns=0)
        leave = services.events.enter(f"{call.principal.kind}:{call.principal.id}")
        try:
            start, told = await services.events.newest(), dict[str, int]()
            async with while_authorized(call):
                async for alert in _unresolved(call, wanted):
                    told[alert.id] = alert.revision
                    yield alerts_pb2.WatchAlertsReply(change="is", alert=views.alert_message(alert))
                yield alerts_pb2.WatchAlertsReply(change="began")
                async with aclosing(services.events.watch(after=start, wanted=_events(wanted, call))) as pages:
                    async for page in pages:
                        for event in page.events:
                            said = orjson.loads(event.data)
                            if _is_news(said, told) and (reply := await _change(call, said, wanted)) is not None:
                                yield reply
            raise DrainingError(ENDING)  # nothing else ends the journal
        finally:
            leave()

    async def AcknowledgeAlert(self, request: alerts_pb2.AlertActionRequest, call: Call) -> Any:
        """Somebody sees to it."""
        return await _said(request, call, call.services.alerts.acknowledge)

    async def UnacknowledgeAlert(self, request: alerts_pb2.AlertActionRequest, call: Call) -> Any:
        """Nobody sees to it after all."""
        return await _said(request, call, call.services.alerts.unacknowledge)

    async def ResolveAlert(self, request: alerts_pb2.AlertActionRequest, call: Call) -> Any:
        """It is over."""
        return await _said(request, call, call.services.alerts.resolve)

    async def CommentAlert(self, request: alerts_pb2.AlertActionRequest, call: Call) -> Any:
        """Say something to it."""
        read_as(models_alerts.AlertComment, text=request.text)
        return await _said(request, call, call.services.alerts.comment)

    async def AssignAlert(self, request: alerts_pb2.AssignAlertRequest, call: Call) -> Any:
        """Say who sees to it."""
        body, found = (
            read_as(models_alerts.AlertAssign, assignee=request.assignee),
            await seen_alert(call, request.alert),
        )
        changed = await call.services.alerts.assign(found.id, assignee=body.assignee, by=call.principal.name)
        call.detail = f"{named(changed)} to {body.assignee or 'nobody'}"
        return views.alert_message(changed)

    async def AcceptAlert(self, request: alerts_pb2.AlertActionRequest, call: Call) -> Any:
        """What was found is normal: teach it to whatever found it."""
        body, found = read_as(models_alerts.AlertText, text=request.text), await seen_alert(call, request.alert)
        taught = await call.services.watch.normal(found)
        changed = await call.services.alerts.normal(found.id, text=body.text, by=call.principal.name)
        call.detail = f"{named(changed)}: {len(taught)} taught"
        return alerts_pb2.AcceptAlertResponse(alert=views.alert_message(changed), taught=taught)

    async def SilenceAlert(self, request: alerts_pb2.SilenceAlertRequest, call: Call) -> Any:
        """Tell nobody of the robot's alerts of this cause for a while."""
        body = read_as(models_alerts.AlertSilence, for_s=request.for_s or HOUR_S, reason=request.reason)
        found = await seen_alert(call, request.alert)
        wanted = models_alerts.SilenceRequest(
            robots=[found.robot] if found.robot else [], causes=[found.cause], for_s=body.for_s, reason=body.reason
        )
        return await _silence(call, wanted)

    async def ClipAlert(self, request: alerts_pb2.AlertActionRequest, call: Call) -> Any:
        """Ask the robot's black box for the evidence; one clip that is on its way is enough."""
        found = await seen_alert(call, request.alert)
        recording = await _clip_of(call, found) or (await call.services.watch.clip(found)).id
        call.detail = f"{named(found)}: recording {recording}"
        return alerts_pb2.ClipAlertResponse(recording=recording)

    async def ListSilences(self, request: alerts_pb2.ListSilencesRequest, call: Call) -> Any:
        """Those that are not over and reach no robot out of scope."""
        found = [one for one in await call.services.alerts.silences() if sees_silence(call.principal, one)]
        return alerts_pb2.ListSilencesResponse(silences=[views.silence_message(one) for one in found])

    async def AddSilence(self, request: alerts_pb2.AddSilenceRequest, call: Call) -> Any:
        """Tell nobody of what matches."""
        wanted = read_as(
            models_alerts.SilenceRequest,
            robots=list(request.robots),
            causes=list(request.causes),
            up_to=request.up_to or "error",
            for_s=request.for_s or HOUR_S,
            reason=request.reason,
        )
        return await _silence(call, wanted)

    async def EndSilence(self, request: alerts_pb2.EndSilenceRequest, call: Call) -> Any:
        """End it now."""
        manager = call.services.alerts
        found = await manager.get_silence(request.silence)
        if not sees_silence(call.principal, found):
            raise UnknownSilenceError.of(request.silence)
        check_silence_scope(call.principal, found.robots)
        call.detail = found.id
        return views.silence_message(await manager.end_silence(found.id, by=call.principal.name))

    async def ListChecks(self, request: alerts_pb2.ListChecksRequest, call: Call) -> Any:
        """Every check as it is now."""
        return alerts_pb2.ListChecksResponse(checks=[views.check_message(row) for row in call.services.watch.checks()])

    async def SetCheck(self, request: alerts_pb2.SetCheckRequest, call: Call) -> Any:
        """Have a check be another for every robot."""
        require_all_robots(call, "checks")
        changes = {name: None if value != value else value for name, value in given(request, CHANGES).items()}
        if not changes:
            raise FieldFaultError("enabled", f"say what is to change: one of {', '.join(CHANGES)}")
        body = read_as(watch.AlertCheckChange, **changes).said()
        row = await call.services.watch.set_check(request.check, body, by=call.principal.name)
        call.detail = f"{row.id}: {', '.join(f'{name} {value}' for name, value in body.items())}"
        return views.check_message(row)

    async def ResetCheck(self, request: alerts_pb2.ResetCheckRequest, call: Call) -> Any:
        """Have a check be as it comes."""
        require_all_robots(call, "checks")
        row = await call.services.watch.reset_check(request.check, by=call.principal.name)
        call.detail = f"{row.id}: as it comes"
        return views.check_message(row)

    async def ListRoutes(self, request: alerts_pb2.ListRoutesRequest, call: Call) -> Any:
        """The routes that name no robot out of scope."""
        found = call.services.notices.routes()
        seen = [one for one in found if not one.robots or covers(call.principal, one.robots)]
        return alerts_pb2.ListRoutesResponse(routes=[views.route_message(one) for one in seen])

    async def TestRoute(self, request: alerts_pb2.TestRouteRequest, call: Call) -> Any:
        """Send a notice that says that it is a test, and wait for what becomes of it."""
        require_all_robots(call, "routes of notices")
        done = await call.services.notices.test(request.route, by=call.principal.name)
        call.detail = f"{request.route[:64]}: {'delivered' if done.ok else 'failed'}"
        status = str(done.status or "")
        return alerts_pb2.TestRouteResponse(ok=done.ok, status=status, error=done.error or "", took_s=done.took_s)

    async def GetLearning(self, request: alerts_pb2.GetLearningRequest, call: Call) -> Any:
        """Which series of a robot are learned still, and how odd each is now."""
        call.require(request.robot)
        call.services.registry.get(request.robot)
        found = await call.services.watch.learning(request.robot)
        return alerts_pb2.GetLearningResponse(series=[views.learning_message(one) for one in found])

    async def GetBand(self, request: alerts_pb2.GetBandRequest, call: Call) -> Any:
        """A series and what was expected of it, as far as the gateway remembers."""
        call.require(request.robot)
        call.services.registry.get(request.robot)
        if not 0 <= request.from_ns < request.to_ns:
            raise FieldFaultError("from_ns", "from_ns and to_ns are in nanoseconds since 1970, the first the earlier")
        points = await call.services.watch.band(request.robot, request.series, request.from_ns, request.to_ns)
        return alerts_pb2.GetBandResponse(points=[views.point_message(point) for point in points])

    async def Backtest(self, request: alerts_pb2.BacktestRequest, call: Call) -> Any:
        """Judge a robot's stored rows again; nothing is changed."""
        services, begin = call.services, request.start or "-24h"
        call.require(request.robot)
        services.registry.get(request.robot)
        body = read_as(
            watch.BacktestRequest,
            robot=request.robot,
            series=list(request.series),
            checks=document(request.checks_json, "checks_json"),
            detectors=list(request.detectors),
        )
        start_ns, end_ns = parse_range(begin, request.end or "now", now_ns=services.clock.wall_ns())
        report = await services.backtests.run(
            BacktestRequest(
                robot=request.robot,
                series=tuple(body.series),
                start_ns=start_ns,
                end_ns=end_ns,
                checks={name: change.said() for name, change in body.checks.items()},
                detectors=tuple(body.detectors),
            )
        )
        call.detail = f"{request.robot}: {report.samples} samples, {len(report.findings)} findings"
        return await asyncio.to_thread(views.report_message, report)


def named(alert: Alert) -> str:
    """An alert in the audit log."""
    return f"{alert.id} {alert.robot or 'fleet'} {alert.cause}"


async def _said(
    request: alerts_pb2.AlertActionRequest, call: Call, act: Callable[..., Awaitable[Alert]]
) -> alerts_pb2.Alert:
    """Do what needs no more than a text."""
    body, found = read_as(models_alerts.AlertText, text=request.text), await seen_alert(call, request.alert)
    changed = await act(found.id, by=call.principal.name, text=body.text)
    call.detail = named(changed)
    return views.alert_message(changed)


async def _silence(call: Call, wanted: models_alerts.SilenceRequest) -> alerts_pb2.AlertSilence:
    check_silence_scope(call.principal, wanted.robots)
    made = await call.services.alerts.add_silence(
        robots=tuple(wanted.robots),
        causes=tuple(wanted.causes),
        up_to=wanted.up_to,
        until_ns=call.services.clock.wall_ns() + round(wanted.for_s * 1e9),
        reason=wanted.reason,
        by=call.principal.name,
    )
    robots, causes = " ".join(made.robots) or "the fleet", " ".join(made.causes) or "everything"
    call.detail = f"{made.id}: {causes} of {robots} for {wanted.for_s:g} s"[:500]
    return views.silence_message(made)


async def _clip_of(call: Call, alert: Alert) -> str:
    """The recording that the alert has already, unless it failed or is gone."""
    if not alert.clip:
        return ""
    try:
        found = await call.services.recordings.get(alert.clip)
    except UnknownRecordingError:
        return ""
    return "" if found.state == "failed" else found.id


async def _unresolved(call: Call, wanted: AlertFilter) -> AsyncIterator[Alert]:
    """Those that match and are not resolved, page by page, the newest first."""
    before: str | None = None
    while True:
        page = await call.services.alerts.list(replace(wanted, states=UNRESOLVED), limit=MAX_LISTED, before=before)
        for alert in page:
            yield alert
        if len(page) < MAX_LISTED:
            return
        before = page[-1].id


def _events(wanted: AlertFilter, call: Call) -> EventFilter:
    principal = call.principal
    sees = None if principal.sees_all else principal.sees
    return EventFilter(kinds=(EVENT_KINDS,), robots=wanted.robots, sees=sees, sees_fleet=principal.sees_all)


def _is_news(said: dict[str, Any], told: dict[str, int]) -> bool:
    """Whether an event says more than the list did, which has told each alert as of a revision.

    An alert is stored before its event is: one that changes as the list is made is in both. Words about an alert are
    always news. What is told is forgotten with the first event that is newer, so `told` only gets smaller.
    """
    alert, revision = str(said["alert"]), int(said.get("revision", 0))
    known = told.get(alert, 0)
    if revision > known:
        told.pop(alert, None)
    return not revision or revision > known


async def _change(call: Call, said: dict[str, Any], wanted: AlertFilter) -> alerts_pb2.WatchAlertsReply | None:
    """What an event says, with the alert as it stands now; None where it is none of the wanted, or gone."""
    try:
        alert = await call.services.alerts.get(str(said["alert"]))
    except UnknownAlertError:
        return None
    if not wanted.matches(alert):
        return None
    return alerts_pb2.WatchAlertsReply(change=str(said["what"]), alert=views.alert_message(alert))
