"""Where notices of alerts go, as the API shows it."""

from __future__ import annotations

from typing import Any

from gateway.alerting.alerts.notices.service import Delivery, RouteState
from gateway.api.views.robots import rfc3339

__all__ = ["delivery_view", "route_view"]


def route_view(route: RouteState) -> dict[str, Any]:
    """A route and what became of its notices."""
    return {
        "name": route.name,
        "kind": route.kind,
        "target": route.target,
        "severity": route.severity,
        "robots": list(route.robots),
        "causes": list(route.causes),
        "sent": route.sent,
        "failed": route.failed,
        "waiting": route.waiting,
        "last": rfc3339(route.last_ns) if route.last_ns else None,
        "last_error": route.last_error,
    }


def delivery_view(done: Delivery) -> dict[str, Any]:
    """What became of one notice."""
    return {"ok": done.ok, "status": done.status, "error": done.error, "took_s": round(done.took_s, 3)}
