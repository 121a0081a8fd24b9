"""Which notice of an alert a route gets next, and when: the last one sent against the alert as it is now. Pure."""

from __future__ import annotations

from dataclasses import dataclass

from gateway.alerting.alerts.notices.document import Stage
from gateway.alerting.alerts.notices.route import Route
from gateway.domain.alert import Alert, rank
from gateway.domain.finding import FindingSeverity

__all__ = ["NEVER", "LastNotice", "next_stage"]

S = 10**9
NEVER = 1 << 63


@dataclass(frozen=True, slots=True, kw_only=True)
class LastNotice:
    """The last notice of an alert that a route got."""

    alert: str
    route: str
    stage: Stage
    severity: FindingSeverity
    times: int
    told_ns: int


def next_stage(alert: Alert, told: LastNotice | None, route: Route) -> tuple[Stage, int]:
    """What the route is told next, and when it is time for that; NEVER as things are now.

    An alert is told when it is `wait_s` old, so that one which is explained by another is not; at once when it gets
    worse; when it began again, but every `again_s` at most; and every `repeat_s` while it is open. That it is
    acknowledged or over is told to whom it was told at all.
    """
    loud = alert.unresolved and not alert.quiet and route.wants(alert)
    if told is None:
        return "opened", (alert.opened_ns + round(route.wait_s * S) if loud else NEVER)
    if not alert.unresolved:
        return "resolved", (alert.resolved_ns if told.stage != "resolved" else NEVER)
    if loud and rank(alert.severity) > rank(told.severity):
        return "opened", 0
    if told.stage == "resolved":  # it began again since
        return "opened", (told.told_ns + round(route.again_s * S) if loud else NEVER)
    if alert.state == "acknowledged":
        return "acknowledged", (alert.acknowledged_ns if told.stage == "opened" else NEVER)
    return "opened", (told.told_ns + round(route.repeat_s * S) if loud else NEVER)
