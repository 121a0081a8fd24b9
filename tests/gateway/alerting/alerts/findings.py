"""Findings and edges for tests, in one short call each."""

from __future__ import annotations

from typing import Any, Literal

from gateway.alerting.alerts.registry import AlertRegistry
from gateway.domain.alert import Alert, Silence
from gateway.domain.finding import Edge, Finding

S = 10**9
NOW = 1_700_000_000 * S


def finding(robot: str = "r1", cause: str = "heat", series: str = "motor.temperature", **more: Any) -> Finding:
    """A warning of a check `limit`, unless said otherwise."""
    fields: dict[str, Any] = {
        "kind": "limit" if cause == "heat" else cause,
        "severity": "warning",
        "score": 0.8,
        "value": 91.0,
        "low": 20.0,
        "high": 80.0,
        "reason": "motor.temperature is 91, expected 20 to 80",
        "since_s": NOW / S,
    }
    return Finding(robot=robot, cause=cause, series=series, **{**fields, **more})


def edge(change: Literal["opened", "changed", "cleared"], *args: Any, **more: Any) -> Edge:
    """The edge of a finding as `finding` makes it."""
    return Edge(change, finding(*args, **more), NOW / S)


def opened(*args: Any, **more: Any) -> Edge:
    """A finding began."""
    return edge("opened", *args, **more)


def cleared(*args: Any, **more: Any) -> Edge:
    """A finding is over."""
    return edge("cleared", *args, **more)


def silence(**more: Any) -> Silence:
    """A silence of everything for an hour."""
    return Silence(**{"id": "S1", "from_ns": NOW, "until_ns": NOW + 3600 * S, "by": "eve", **more})


def stored(registry: AlertRegistry, now_ns: int = NOW) -> list[tuple[Alert, tuple[str, ...]]]:
    """Store what is to be stored, as the manager does; the alerts and their news."""
    found = []
    while changes := registry.changes(now_ns, most=10_000, all_of_it=True):
        for change in changes:
            registry.stored(change)
            found.append((change.alert, change.news))
    return found


def only(registry: AlertRegistry, robot: str = "r1") -> Alert:
    """The robot's one alert that is not resolved."""
    (alert,) = registry.of(robot)
    return alert
