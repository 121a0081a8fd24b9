"""Alerts and what belongs to them as messages of AlertService; a number that is none is left out."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from gateway.alerting.alerts.causes import title_of
from gateway.alerting.alerts.links import alert_path
from gateway.alerting.backtest import Fired, Report
from gateway.alerting.watch.rows import BandPoint, CheckRow, SeriesWatch
from gateway.domain.alert import Alert, Evidence, Remark, Silence
from gateway.domain.finding import Finding
from metaros._proto import alerts_pb2

if TYPE_CHECKING:
    from gateway.alerting.alerts.notices.service import RouteState

__all__ = [
    "alert_message",
    "check_message",
    "evidence_message",
    "learning_message",
    "point_message",
    "remark_message",
    "report_message",
    "route_message",
    "silence_message",
]

_ALERT = (
    *("id", "robot", "cause", "state", "severity", "title", "reason", "series", "detector", "score"),
    *("opened_ns", "first_ns", "changed_ns", "seen_ns", "resolved_ns", "resolved_by", "acknowledged_ns"),
    *("acknowledged_by", "assignee", "times", "clip", "inhibited_by", "silence", "gateway", "revision"),
)
_CHECK = ("id", "title", "unit", "severity", "enabled", "for_s", "clear_s", "changed", "by", "at_ns")
_ROUTE = ("name", "kind", "target", "severity", "robots", "causes", "sent", "failed", "waiting", "last_ns")


def alert_message(alert: Alert) -> alerts_pb2.Alert:
    """An alert without its findings and remarks."""
    return alerts_pb2.Alert(**_fields(alert, _ALERT), **_measured(alert), path=alert_path(alert))


def evidence_message(evidence: Evidence) -> alerts_pb2.AlertFinding:
    """A finding of an alert."""
    return _finding(evidence.finding, active=evidence.active, at_ns=round(evidence.finding.since_s * 1e9))


def remark_message(remark: Remark) -> alerts_pb2.AlertRemark:
    """What somebody said or did."""
    return alerts_pb2.AlertRemark(**_fields(remark, ("number", "at_ns", "by", "kind", "text")))


def silence_message(silence: Silence) -> alerts_pb2.AlertSilence:
    """A silence."""
    names = ("id", "robots", "causes", "up_to", "from_ns", "until_ns", "by", "reason")
    return alerts_pb2.AlertSilence(**_fields(silence, names))


def check_message(row: CheckRow) -> alerts_pb2.AlertCheck:
    """A check as it is in force."""
    return alerts_pb2.AlertCheck(**_fields(row, _CHECK), low=plain(row.low), high=plain(row.high))


def route_message(route: RouteState) -> alerts_pb2.AlertRoute:
    """A route and what became of its notices."""
    return alerts_pb2.AlertRoute(**_fields(route, _ROUTE), last_error=route.last_error or "")


def learning_message(one: SeriesWatch) -> alerts_pb2.SeriesLearning:
    """How far a series is learned."""
    return alerts_pb2.SeriesLearning(
        series=one.series, seen=one.seen, of=one.of, score=one.score, low=plain(one.low), high=plain(one.high)
    )


def point_message(point: BandPoint) -> alerts_pb2.BandPoint:
    """A sample with what was expected."""
    return alerts_pb2.BandPoint(stamp_ns=point.stamp_ns, score=point.score, **_measured(point))


def report_message(report: Report) -> alerts_pb2.BacktestReport:
    """All that a backtest says."""
    alerts = [
        alerts_pb2.BacktestAlert(
            **_fields(item, ("cause", "severity", "reason", "first_ns", "last_ns", "findings")),
            title=title_of(item.cause),
        )
        for item in report.alerts
    ]
    series = [
        alerts_pb2.BacktestSeries(
            series=item.series,
            samples=item.samples,
            points=[point_message(BandPoint(*point)) for point in item.points],
        )
        for item in report.series
    ]
    return alerts_pb2.BacktestReport(
        robot=report.robot,
        from_ns=report.start_ns,
        to_ns=report.end_ns,
        samples=report.samples,
        findings=[_fired(item) for item in report.findings],
        alerts=alerts,
        series=series,
        cut=report.cut,
        took_s=report.took_s,
    )


def plain(value: float | None) -> float | None:
    """A number, None where there is none."""
    return value if value is not None and math.isfinite(value) else None


def _fired(item: Fired) -> alerts_pb2.AlertFinding:
    found = _finding(item.finding, active=not item.cleared_ns, at_ns=item.opened_ns)
    found.until_ns = item.cleared_ns
    return found


def _finding(finding: Finding, *, active: bool, at_ns: int) -> alerts_pb2.AlertFinding:
    return alerts_pb2.AlertFinding(
        **_fields(finding, ("series", "severity", "score", "reason", "cause")),
        **_measured(finding),
        detector=finding.kind,
        at_ns=at_ns,
        active=active,
    )


def _measured(item: Any) -> dict[str, Any]:
    return {name: plain(getattr(item, name)) for name in ("value", "low", "high")}


def _fields(item: Any, names: tuple[str, ...]) -> dict[str, Any]:
    return {name: getattr(item, name) for name in names}
