"""An event as a CloudEvents 1.0 document, which is how it leaves the gateway."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

import orjson

from gateway.domain.automation.event import Event

__all__ = ["TYPE_PREFIX", "cloud_event"]

TYPE_PREFIX = "metaros."


def cloud_event(event: Event) -> dict[str, Any]:
    """The event's document: `id` is its cursor, `source` the robot or the fleet, `subject` the robot's id."""
    moment = datetime.fromtimestamp(event.at_ns / 1e9, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    document: dict[str, Any] = {
        "specversion": "1.0",
        "id": str(event.seq),
        "source": f"/api/v1/robots/{event.robot}" if event.robot else "/api/v1",
        "type": TYPE_PREFIX + event.kind,
        "time": moment,
        "datacontenttype": "application/json",
        "gateway": event.gateway,
        "data": orjson.loads(event.data),
    }
    if event.robot:
        document["subject"] = event.robot
    return document
