"""When a route is told what: waiting, getting worse, beginning again, repetition, the end."""

from __future__ import annotations

from typing import Any

from gateway.alerting.alerts.notices.plan import NEVER, LastNotice, next_stage
from gateway.alerting.alerts.notices.route import Route
from gateway.domain.alert import Alert
from gateway.outbound.webhook import Webhook
from tests.gateway.alerting.alerts.findings import NOW, S

ROUTE = Route(name="ops", to=Webhook(url="https://hooks.example.org/"))
LATER = NOW + 3600 * S


def alert(**more: Any) -> Alert:
    """An open one of a moment ago."""
    fields: dict[str, Any] = {"state": "open", "severity": "warning", "robot": "r1", "cause": "heat"}
    at_ns = {"opened_ns": NOW, "first_ns": NOW, "changed_ns": NOW, "seen_ns": NOW}
    return Alert(id="A", title="Too hot", **{**fields, **at_ns, **more})


def reported(stage: Any = "opened", **more: Any) -> LastNotice:
    """What the route was told a second later."""
    fields: dict[str, Any] = {"severity": "warning", "times": 1, "told_ns": NOW + S}
    return LastNotice(alert="A", route="ops", stage=stage, **{**fields, **more})


NEXT: tuple[tuple[Alert, LastNotice | None, tuple[str, int]], ...] = (
    (alert(), None, ("opened", NOW + 10 * S)),
    (alert(severity="info"), None, ("opened", NEVER)),
    (alert(inhibited_by="B"), None, ("opened", NEVER)),
    (alert(silence="S"), None, ("opened", NEVER)),
    (alert(state="acknowledged", acknowledged_ns=NOW + S), None, ("opened", NOW + 10 * S)),
    (alert(state="resolved", resolved_ns=LATER), None, ("opened", NEVER)),
    (alert(), reported(), ("opened", NOW + S + 14_400 * S)),
    (alert(silence="S"), reported(), ("opened", NEVER)),
    (alert(severity="error"), reported(), ("opened", 0)),
    (alert(severity="error", state="acknowledged"), reported(), ("opened", 0)),
    (alert(state="acknowledged", acknowledged_ns=LATER), reported(), ("acknowledged", LATER)),
    (alert(state="acknowledged", acknowledged_ns=LATER), reported("acknowledged"), ("acknowledged", NEVER)),
    (alert(), reported("acknowledged"), ("opened", NOW + S + 14_400 * S)),
    (alert(state="resolved", resolved_ns=LATER), reported(), ("resolved", LATER)),
    (alert(state="resolved", resolved_ns=LATER, silence="S"), reported(), ("resolved", LATER)),
    (alert(state="resolved", resolved_ns=LATER), reported("resolved"), ("resolved", NEVER)),
    (alert(times=2), reported("resolved"), ("opened", NOW + S + 600 * S)),
    (alert(times=2, silence="S"), reported("resolved"), ("opened", NEVER)),
)


def test_what_is_reported_next() -> None:
    found = [(now, before, next_stage(now, before, ROUTE), expected) for now, before, expected in NEXT]
    assert [case for case in found if case[2] != case[3]] == []


def test_a_route_wants_some_robots_and_causes_only() -> None:
    route = Route(name="ops", to=ROUTE.to, robots=("agv-*",), causes=("heat", "batt*"), severity="error")
    assert route.wants(alert(robot="agv-1", severity="error"))
    assert not route.wants(alert(robot="arm-1", severity="error"))
    assert not route.wants(alert(robot="agv-1"))
    assert not route.wants(alert(robot="agv-1", severity="error", cause="offline"))
