"""Alerts, silences and what is watched, as the API shows them."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Any

from gateway.alerting.alerts.links import alert_path
from gateway.alerting.watch.rows import BandPoint, CheckRow, SeriesWatch
from gateway.api.views.robots import rfc3339
from gateway.domain.alert import Alert, Evidence, Remark, Silence

__all__ = [
    "alert_detail_view",
    "alert_view",
    "check_view",
    "counts_view",
    "finding_view",
    "point_view",
    "remark_view",
    "series_watch_view",
    "silence_view",
]


def alert_view(alert: Alert) -> dict[str, Any]:
    """An alert without its findings and remarks."""
    return {
        "id": alert.id,
        "robot": alert.robot,
        "cause": alert.cause,
        "state": alert.state,
        "severity": alert.severity,
        "title": alert.title,
        "reason": alert.reason,
        "series": alert.series,
        "detector": alert.detector,
        "score": alert.score,
        "value": _number(alert.value),
        "low": _number(alert.low),
        "high": _number(alert.high),
        "opened": rfc3339(alert.opened_ns),
        "first": rfc3339(alert.first_ns),
        "changed": rfc3339(alert.changed_ns),
        "seen": rfc3339(alert.seen_ns),
        "clearing": _time(alert.clear_ns) if not alert.resolved_ns else None,
        "resolved": _time(alert.resolved_ns),
        "resolved_by": alert.resolved_by,
        "acknowledged": _time(alert.acknowledged_ns),
        "acknowledged_by": alert.acknowledged_by,
        "assignee": alert.assignee,
        "times": alert.times,
        "clip": alert.clip,
        "inhibited_by": alert.inhibited_by,
        "silence": alert.silence,
        "quiet": alert.quiet,
        "gateway": alert.gateway,
        "revision": alert.revision,
        "path": alert_path(alert),
    }


def alert_detail_view(alert: Alert, remarks: Iterable[Remark]) -> dict[str, Any]:
    """An alert with its findings and remarks."""
    findings = [finding_view(evidence) for evidence in alert.findings]
    return {**alert_view(alert), "findings": findings, "remarks": [remark_view(remark) for remark in remarks]}


def counts_view(counts: Mapping[str, Any]) -> dict[str, int]:
    """The counts of alerts in one row; `open` are those that are not resolved and not quiet."""
    loud = counts["severities"]
    return {"open": sum(loud.values()), "acknowledged": counts["acknowledged"], "quiet": counts["quiet"], **loud}


def finding_view(evidence: Evidence) -> dict[str, Any]:
    """One finding of an alert."""
    finding = evidence.finding
    return {
        "detector": finding.kind,
        "series": finding.series,
        "severity": finding.severity,
        "score": finding.score,
        "value": _number(finding.value),
        "low": _number(finding.low),
        "high": _number(finding.high),
        "reason": finding.reason,
        "at": rfc3339(round(finding.since_s * 1e9)),
        "active": evidence.active,
    }


def remark_view(remark: Remark) -> dict[str, Any]:
    """What somebody said or did."""
    return {
        "number": remark.number,
        "at": rfc3339(remark.at_ns),
        "by": remark.by,
        "kind": remark.kind,
        "text": remark.text,
    }


def silence_view(silence: Silence) -> dict[str, Any]:
    """A silence."""
    return {
        "id": silence.id,
        "robots": list(silence.robots),
        "causes": list(silence.causes),
        "up_to": silence.up_to,
        "from": rfc3339(silence.from_ns),
        "until": rfc3339(silence.until_ns),
        "by": silence.by,
        "reason": silence.reason,
    }


def check_view(row: CheckRow) -> dict[str, Any]:
    """A check as it is now."""
    return {
        "id": row.id,
        "title": row.title,
        "unit": row.unit,
        "enabled": row.enabled,
        "low": _number(row.low),
        "high": _number(row.high),
        "for_s": row.for_s,
        "clear_s": row.clear_s,
        "severity": row.severity,
        "changed": list(row.changed),
        "changed_by": row.by,
        "changed_at": _time(row.at_ns),
    }


def series_watch_view(one: SeriesWatch) -> dict[str, Any]:
    """How far a series is learned, and what is expected now."""
    return {
        "series": one.series,
        "seen": one.seen,
        "of": one.of,
        "score": one.score,
        "low": _number(one.low),
        "high": _number(one.high),
    }


def point_view(point: BandPoint) -> list[float | None]:
    """A sample, what was expected, and its score: [stamp_ms, value, low, high, score]."""
    return [point.stamp_ns / 1e6, _number(point.value), _number(point.low), _number(point.high), point.score]


def _number(value: float | None) -> float | None:
    """A number that JSON has; None where there is none, or no finite one."""
    return value if value is not None and math.isfinite(value) else None


def _time(wall_ns: int) -> str | None:
    return rfc3339(wall_ns) if wall_ns else None
