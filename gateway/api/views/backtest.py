"""A backtest's report as the API shows it."""

from __future__ import annotations

import math
from typing import Any

from gateway.alerting.alerts.causes import title_of
from gateway.alerting.backtest import Fired, Report, SeriesReport, SimulatedAlert
from gateway.api.views.robots import rfc3339

__all__ = ["backtest_view"]


def backtest_view(report: Report) -> dict[str, Any]:
    """The JSON of POST /api/v1/backtests; stamps of points are in ms."""
    return {
        "robot": report.robot,
        "span": {"from": rfc3339(report.start_ns), "to": rfc3339(report.end_ns)},
        "samples": report.samples,
        "findings": [_finding(item) for item in report.findings],
        "alerts": [_alert(item) for item in report.alerts],
        "series": [_series(item) for item in report.series],
        "cut": report.cut,
        "took_s": round(report.took_s, 3),
    }


def _finding(item: Fired) -> dict[str, Any]:
    finding = item.finding
    return {
        "series": finding.series,
        "detector": finding.kind,
        "cause": finding.cause,
        "severity": finding.severity,
        "score": finding.score,
        "value": plain(finding.value),
        "low": plain(finding.low),
        "high": plain(finding.high),
        "reason": finding.reason,
        "at": rfc3339(item.opened_ns),
        "until": rfc3339(item.cleared_ns) if item.cleared_ns else None,
    }


def _alert(item: SimulatedAlert) -> dict[str, Any]:
    return {
        "cause": item.cause,
        "severity": item.severity,
        "title": title_of(item.cause),
        "reason": item.reason,
        "first": rfc3339(item.first_ns),
        "last": rfc3339(item.last_ns) if item.last_ns else None,
        "findings": item.findings,
    }


def _series(item: SeriesReport) -> dict[str, Any]:
    points = [[stamp_ns / 1e6, value, low, high, score] for stamp_ns, value, low, high, score in item.points]
    return {"series": item.series, "samples": item.samples, "points": points}


def plain(value: float) -> float | None:
    """A number as JSON takes it; null where there is none."""
    return value if math.isfinite(value) else None
