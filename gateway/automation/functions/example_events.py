"""Events to try a function or rule with, each in the shape that the real one has."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from gateway.domain.automation.gateway_event import JOURNAL, METRIC, SCHEDULE, TOPIC, WEBHOOK, GatewayEvent
from gateway.domain.automation.shapes import STORED, cloudevent, eventbridge, s3

__all__ = ["EXAMPLE_EVENTS", "ExampleEvent"]

AT_NS = 1_767_225_600_000_000_000  # the first second of 2026
ROBOT = "sim_1"


@dataclass(frozen=True, slots=True)
class ExampleEvent:
    """One row: when such a thing comes, and what a handler is given."""

    name: str
    meaning: str
    event: Mapping[str, Any]


def _one(name: str, source: str, data: dict[str, Any], *, robot: str = ROBOT, ident: str = "e-4711") -> GatewayEvent:
    return GatewayEvent(id=ident, type=name, source=source, at_ns=AT_NS, robot=robot, data=data)


_ALERT = _one(
    f"{JOURNAL}.alert.opened",
    JOURNAL,
    {
        "alert": "A17",
        "cause": "heat",
        "severity": "error",
        "state": "open",
        "title": "Left motor overheats",
        "reason": "97.5 °C is above 95 °C",
        "times": 1,
        "quiet": False,
        "what": "opened",
        "by": "",
        "revision": 1,
    },
)
_STORED = _one(STORED, JOURNAL, {"recording": "R42", "size_bytes": 1_250_000})
_BATTERY = _one(
    METRIC,
    "metaros.metric",
    {
        "series": "battery_state.percentage",
        "value": 0.18,
        "stamp_ns": AT_NS,
        "above": None,
        "below": 0.2,
        "rule": "battery_low",
    },
    ident=f"{ROBOT}/battery_low/{AT_NS}",
)
_TOPIC = _one(
    TOPIC,
    "metaros.topic",
    {
        "topic": f"/{ROBOT}/battery_state",
        "type": "sensor_msgs/msg/BatteryState",
        "stamp_ns": AT_NS,
        "seq": 12,
        "message": {"voltage": 23.1, "percentage": 0.18, "power_supply_status": 2, "present": True},
    },
    ident=f"{ROBOT}/3/1/12",
)
# Long arrays of bytes are only counted: whoever wants the picture fetches it.
_IMAGE = _one(
    TOPIC,
    "metaros.topic",
    {
        "topic": f"/{ROBOT}/camera/image/compressed",
        "type": "sensor_msgs/msg/CompressedImage",
        "stamp_ns": AT_NS,
        "seq": 7,
        "message": {
            "header": {"stamp": {"sec": AT_NS // 10**9, "nanosec": 0}, "frame_id": "sim_1/camera"},
            "format": "jpeg",
            "data": {"bytes": 12250},
        },
    },
    ident=f"{ROBOT}/5/1/7",
)
_OFFLINE = _one(f"{JOURNAL}.robot.offline", JOURNAL, {})
_SCHEDULE = _one(
    SCHEDULE,
    SCHEDULE,
    {"rule": "nightly", "expression": "cron(0 0 * * ? *)", "late_s": 0.0},
    robot="",
    ident="nightly/2026-01-01T00:00:00Z",
)
_WEBHOOK = _one(
    WEBHOOK,
    f"{WEBHOOK}/shop",
    {"hook": "shop", "headers": {"content-type": "application/json"}, "body": {"order": 17, "item": "spare wheel"}},
    robot="",
    ident="msg_2b7Y",
)
_USER = _one("order.ready", "user", {"order": 17, "robot": ROBOT}, ident="01JGFJ3V000000000000000000")

EXAMPLE_EVENTS: dict[str, ExampleEvent] = {
    row.name: row
    for row in (
        ExampleEvent("alert", "an alert opened", eventbridge(_ALERT)),
        ExampleEvent("battery_low", "a series went below a bound (a metric rule)", eventbridge(_BATTERY)),
        ExampleEvent("topic", "a message of a robot's topic", eventbridge(_TOPIC)),
        ExampleEvent("image", "a compressed picture of a robot's camera", eventbridge(_IMAGE)),
        ExampleEvent("recording", "a recording's file is here", eventbridge(_STORED)),
        ExampleEvent("recording_s3", "the same in the shape of S3 (event_format: s3)", s3(_STORED)),
        ExampleEvent("robot_offline", "a robot's link ended", eventbridge(_OFFLINE)),
        ExampleEvent("schedule", "a rule's schedule", eventbridge(_SCHEDULE)),
        ExampleEvent("webhook", "somebody's webhook came in by a hook", eventbridge(_WEBHOOK)),
        ExampleEvent("user", "what a program of yours put", eventbridge(_USER)),
        ExampleEvent("cloudevent", "the alert as CloudEvents 1.0 has it", cloudevent(_ALERT)),
    )
}
