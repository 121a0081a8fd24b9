"""Where an alert is shown: paths of the dashboard."""

from __future__ import annotations

from datetime import UTC, datetime
from urllib.parse import quote

from gateway.domain.alert import Alert

__all__ = ["alert_path", "moment"]

SPAN = "15m"  # of the time bar on the robot's page


def alert_path(alert: Alert) -> str:
    """The robot's page in the dashboard at the time when the alert began; of the fleet's own alerts that of alerts."""
    if not alert.robot:
        return "/alerts"
    return f"/robots/{quote(alert.robot, safe='')}?t={moment(alert.first_ns)}&span={SPAN}"


def moment(wall_ns: int) -> str:
    """A time in UTC with milliseconds, as RFC 3339 writes it."""
    return datetime.fromtimestamp(wall_ns / 1e9, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
