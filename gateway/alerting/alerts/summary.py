"""Counts of alerts by state and severity, and an alert as an event of the journal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import Any

from gateway.domain.alert import Alert
from gateway.domain.finding import SEVERITIES

__all__ = ["alert_counts", "event_of", "robot_counts"]

_KINDS = {"opened": "alert.opened", "acknowledged": "alert.acknowledged", "resolved": "alert.resolved"}


def robot_counts(alerts: Iterable[Alert]) -> dict[str, int]:
    """Of a robot's unresolved alerts: how many are not quiet, and of those how many are errors and warnings."""
    loud = Counter(alert.severity for alert in alerts if not alert.quiet)
    return {"open": loud.total(), "error": loud["error"], "warning": loud["warning"]}


def alert_counts(alerts: Iterable[Alert], sees: Callable[[str], bool] | None) -> dict[str, Any]:
    """How many are open, acknowledged, and quiet (of either), and how bad those are that are not quiet."""
    states: Counter[str] = Counter()
    severities: Counter[str] = Counter()
    seen: dict[str, bool] = {}
    quiet = 0
    for alert in alerts:
        if alert.unresolved and sees is not None and alert.robot not in seen:
            seen[alert.robot] = sees(alert.robot)
        if alert.unresolved and seen.get(alert.robot, True):
            states[alert.state] += 1
            quiet += alert.quiet
            severities[alert.severity] += not alert.quiet
    found = {severity: severities[severity] for severity in SEVERITIES}
    return {"open": states["open"], "acknowledged": states["acknowledged"], "quiet": quiet, "severities": found}


def event_of(what: str, alert: Alert, *, by: str, remark: bool = False) -> tuple[str, str, dict[str, Any]]:
    """The journal's event: its kind, its robot, its data. A remark makes no revision of the alert."""
    data = {
        "alert": alert.id,
        "cause": alert.cause,
        "severity": alert.severity,
        "state": alert.state,
        "title": alert.title,
        "reason": alert.reason,
        "times": alert.times,
        "quiet": alert.quiet,
        "what": what,
        "by": by,
        "revision": 0 if remark else alert.revision,
    }
    return _KINDS.get(what, "alert.changed"), alert.robot, data
