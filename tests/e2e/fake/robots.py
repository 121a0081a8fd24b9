"""Robots for the browser tests: synthetic, exact in every message, encoded by the real CDR codecs."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import cv2
import numpy as np

from metaros.cdr import codec
from metaros.idl import message_class, schema_text, type_hash
from metaros.wire import qos_default, qos_sensor_data

__all__ = ["QUIET", "TOPICS", "FakeRobot", "FakeTopic"]

ROOM = (-7.0, 7.0, -4.0, 4.0)
PILLARS = ((-3.0, 0.0, 0.5), (3.2, 1.2, 0.4))
RAYS = 360
RANGE_MAX_M = 12.0


@dataclass(frozen=True)
class FakeTopic:
    """A topic of every fake robot: its name below the namespace, type, class and rate."""

    name: str
    type: str
    kind: str
    rate_hz: float


TOPICS = (
    FakeTopic("odom", "nav_msgs/msg/Odometry", "live", 10.0),
    FakeTopic("scan", "sensor_msgs/msg/LaserScan", "live", 10.0),
    FakeTopic("imu", "sensor_msgs/msg/Imu", "live", 50.0),
    FakeTopic("camera/image/compressed", "sensor_msgs/msg/CompressedImage", "live", 10.0),
    FakeTopic("battery_state", "sensor_msgs/msg/BatteryState", "metric", 1.0),
    FakeTopic("motor_temperature", "sensor_msgs/msg/Temperature", "metric", 1.0),
    FakeTopic("note", "std_msgs/msg/String", "live", 1.0),
    FakeTopic("cmd_vel", "geometry_msgs/msg/Twist", "live", 0.0),
)
# Without what is drawn many times a second: a page with a live map and a camera takes half a core.
QUIET = tuple(topic for topic in TOPICS if topic.rate_hz <= 1.0)


def _message(name: str, **fields: Any) -> Any:
    return message_class(name)(**fields)


@dataclass
class FakeRobot:
    """A robot that drives a figure of eight through a room with two pillars, or where a driver sends it."""

    id: str
    namespace: str
    phase: float = 0.0
    battery: float = 0.8
    state: str = "online"
    note: str = "all well"
    waiting_bytes: int = 0
    budget_bytes_per_s: int | None = None
    gaps: int = 0
    hot_from_s: float | None = None
    told: tuple[FakeTopic, ...] = TOPICS
    alerts: dict[str, int] = field(default_factory=lambda: {"open": 0, "error": 0, "warning": 0})
    driven: list[dict[str, Any]] = field(default_factory=list)

    @property
    def topics(self) -> tuple[FakeTopic, ...]:
        """What it publishes and subscribes to."""
        return self.told

    def topic(self, name: str) -> str:
        """The full name of one of its topics."""
        return f"{self.namespace}/{name}"

    def pose(self, at_s: float) -> tuple[float, float, float]:
        """Where it is and looks at an instant."""
        angle = 0.25 * at_s + self.phase
        x, y = 4.6 * math.sin(angle), 2.3 * math.sin(2 * angle)
        return x, y, math.atan2(4.6 * math.cos(2 * angle), 4.6 * math.cos(angle))

    def metrics(self, at_s: float) -> dict[str, float]:
        """Its numeric series at an instant."""
        return {
            "battery_state.percentage": self.battery,
            "battery_state.voltage": 24.0 + self.battery,
            "odom.pose.pose.position.x": self.pose(at_s)[0],
            "odom.pose.pose.position.y": self.pose(at_s)[1],
            "imu.angular_velocity.z": math.sin(at_s),
            "imu.linear_acceleration.x": 0.4 * math.cos(2 * at_s),
            "odom.twist.twist.linear.x": 0.6 + 0.2 * math.sin(at_s),
            "motor_temperature.temperature": 41.0 + math.sin(at_s / 9) + self.heat(at_s),
            "host.cpu.percent": 35.0 + 25.0 * math.sin(at_s / 3 + self.phase),
            "host.memory.percent": 48.0 + math.sin(at_s / 20),
            "host.network.rx_bytes_per_s": 52_000 + 9_000 * math.sin(at_s / 4),
            "host.network.tx_bytes_per_s": 131_000 + 20_000 * math.cos(at_s / 5),
        }

    def heat(self, at_s: float) -> float:
        """How much hotter its motor is than it should be: up to 56 °C, where one has been getting hot."""
        if self.hot_from_s is None or at_s < self.hot_from_s:
            return 0.0
        return 56.0 * (1 - math.exp((self.hot_from_s - at_s) / 40))

    def encode(self, topic: FakeTopic, at_s: float) -> bytes:
        """The CDR bytes of a topic's message at an instant."""
        stamp = _message("builtin_interfaces/msg/Time", sec=int(at_s), nanosec=int(at_s % 1 * 1e9))
        header = _message("std_msgs/msg/Header", stamp=stamp, frame_id="base")
        return codec(topic.type).encode(getattr(self, f"_{topic.name.split('/')[0]}")(header, at_s))

    def stored(self, topic: FakeTopic, at_s: float) -> bytes:
        """The CDR bytes of what a store has of that instant."""
        return self.encode(topic, at_s)

    def _odom(self, header: Any, at_s: float) -> Any:
        x, y, yaw = self.pose(at_s)
        message = _message("nav_msgs/msg/Odometry", header=header, child_frame_id="base")
        message.pose.pose.position.x, message.pose.pose.position.y = x, y
        message.pose.pose.orientation.z, message.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
        return message

    def _scan(self, header: Any, at_s: float) -> Any:
        step = 2 * math.pi / RAYS
        return _message(
            "sensor_msgs/msg/LaserScan",
            header=header,
            angle_min=-math.pi,
            angle_max=math.pi - step,
            angle_increment=step,
            range_min=0.05,
            range_max=RANGE_MAX_M,
            ranges=_cast(*self.pose(at_s), step).astype(np.float32),
        )

    def _imu(self, header: Any, at_s: float) -> Any:
        message = _message("sensor_msgs/msg/Imu", header=header)
        message.angular_velocity.z, message.linear_acceleration.x = math.sin(at_s), 0.4 * math.cos(2 * at_s)
        return message

    def _camera(self, header: Any, at_s: float) -> Any:
        column = np.linspace(0, 255, 320, dtype=np.uint8)
        picture = np.stack(
            [np.tile(column, (240, 1)), np.full((240, 320), 90, np.uint8), np.tile(column[::-1], (240, 1))], 2
        )
        cv2.circle(picture, (int(160 + 110 * math.sin(at_s)), 120), 34, (235, 240, 240), -1)
        data = cv2.imencode(".jpg", picture)[1]
        return _message("sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=data.ravel())

    def _battery(self, header: Any, at_s: float) -> Any:
        return _message("sensor_msgs/msg/BatteryState", header=header, percentage=self.battery, voltage=24.0)

    _battery_state = _battery

    def _motor_temperature(self, header: Any, at_s: float) -> Any:
        return _message("sensor_msgs/msg/Temperature", header=header, temperature=41.0)

    def _note(self, header: Any, at_s: float) -> Any:
        return _message("std_msgs/msg/String", data=self.note)

    def describe(self, now: str) -> dict[str, Any]:
        """The contract's Robot."""
        return {
            "id": self.id,
            "namespace": self.namespace,
            "hostname": "bench",
            "state": self.state,
            "since": now,
            "last_seen": now,
            "agent_version": "2.0.0",
            "labels": {},
            "link": self.describe_link(),
            "channels": len(self.topics),
            "counts": {"samples": 1, "bytes": 1, "duplicates": 0, "gaps": 0, "lost": 0},
            "lease": None,
            "latest": {},
            "alerts": self.alerts,
        }

    def describe_link(self) -> dict[str, Any]:
        """The contract's link of a robot."""
        quotas = {"event": 64 << 20, "metric": 256 << 20, "bulk": 2 << 30, "live": 8 << 20}
        depth = {"fresh_bytes": 0, "backfill_bytes": 0, "samples": 0, "lost": 0, "disk_bytes": 0}
        classes = [{"name": name, **depth, "quota_bytes": quota} for name, quota in quotas.items()]
        classes[2] |= {"backfill_bytes": self.waiting_bytes, "samples": self.waiting_bytes // 1000}
        link: dict[str, Any] = {"session": 1, "rtt_ms": 1.2, "outbox_bytes": 0, "outbox_samples": 0}
        link |= {"bytes_per_s": 83_000.0, "transport": "grpc", "gateway": "127.0.0.1:8081", "reconnects": 2}
        link |= {"budget_bytes_per_s": self.budget_bytes_per_s, "sent_bytes_per_s": 84_000.0, "classes": classes}
        return link | {"disk_free_bytes": 12_000_000_000, "clock_offset_ms": 3.0, "forks": 0, "epochs": 1}

    def describe_gaps(self, now: str) -> list[dict[str, Any]]:
        """The contract's declared losses: one of scans, one of metric rows."""
        common = {"epoch": "00000000000000ff", "lost_from": now, "lost_to": now, "declared": now}
        scan = {"topic": self.topic("scan"), "class": "bulk", "stream": 2, "backfill": True, "reason": "outbox_full"}
        rows = {"topic": None, "class": "metric", "stream": 0, "backfill": False, "reason": "<b>odd</b>"}
        gaps = [scan | {"from": 1001, "to": 3500, "count": 2500}, rows | {"from": 7, "to": 7, "count": 1}]
        return [gap | common for gap in gaps[: self.gaps]]

    def describe_topic(self, number: int, topic: FakeTopic) -> dict[str, Any]:
        """The contract's topic."""
        row: dict[str, Any] = {
            "channel": number,
            "topic": self.topic(topic.name),
            "type": topic.type,
            "class": topic.kind,
        }
        row |= {
            "type_hash": type_hash(topic.type),
            "encoding": "cdr",
            "forward": True,
            "qos": (qos_sensor_data if topic.kind == "live" else qos_default).encode(),
            "demand_hz": None,
            "history_hz": 0.0,
        }
        row |= {"rate_hz": topic.rate_hz, "bytes_per_s": 900.0, "messages": int(topic.rate_hz * 10), "dropped": 0}
        row |= {"thinned": 0}
        row |= {"publishers": int(topic.rate_hz > 0), "subscribers": int(topic.rate_hz == 0), "last_stamp_ms": None}
        return row | {"received": 10, "received_bytes": 900, "lost": 0}

    def describe_channel(self, number: int, topic: FakeTopic) -> dict[str, Any]:
        """The stream's notice of a channel."""
        row = {
            "op": "channel",
            "channel": number,
            "robot": self.id,
            "topic": self.topic(topic.name),
            "type": topic.type,
        }
        row |= {"type_hash": type_hash(topic.type), "encoding": "cdr", "schema_encoding": "ros2msg"}
        return row | {"schema": schema_text(topic.type)}


def _cast(x: float, y: float, yaw: float, step: float) -> Any:
    """Ranges to the room's walls and pillars."""
    angles = yaw - math.pi + step * np.arange(RAYS)
    cos, sin = np.cos(angles), np.sin(angles)
    left, right, bottom, top = ROOM
    with np.errstate(divide="ignore"):
        ranges = np.minimum(
            np.where(cos > 0, (right - x) / cos, (left - x) / cos),
            np.where(sin > 0, (top - y) / sin, (bottom - y) / sin),
        )
    for px, py, radius in PILLARS:
        along = (px - x) * cos + (py - y) * sin
        off = np.abs((px - x) * sin - (py - y) * cos)
        with np.errstate(invalid="ignore"):
            near = along - np.sqrt(radius**2 - off**2)
        ranges = np.where((along > 0) & (off < radius) & (near < ranges), near, ranges)
    return ranges
