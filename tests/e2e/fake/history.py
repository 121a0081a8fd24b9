"""What the fake gateway has stored: the same fake robots at the instants that a history keeps, with a loss if asked."""

from __future__ import annotations

import base64
import datetime
import json
import math
import re
import struct
from collections.abc import Callable, Iterator
from typing import Annotated, Any

from fastapi import FastAPI, Query
from fastapi.responses import Response

from tests.e2e.fake.robots import FakeRobot, FakeTopic

__all__ = ["KEPT_HZ", "FakeHistory"]

KEPT_HZ = {"odom": 2.0, "scan": 1.0, "imu": 1.0, "camera/image/compressed": 0.2, "battery_state": 1.0}
KEPT_HZ |= {"motor_temperature": 1.0, "note": 1.0, "diagnostics": 2.0, "camera/video": 2.0}
RELATIVE = {"s": 1, "m": 60, "h": 3600, "d": 86400}
Names = Annotated[list[str], Query()]


def iso(at_s: float) -> str:
    """A wall-clock time as the API writes it."""
    return datetime.datetime.fromtimestamp(at_s, datetime.UTC).isoformat(timespec="milliseconds")


class FakeHistory:
    """Two hours of every robot before `began_s`, and all since; nothing within `losses` (begin and end in seconds)."""

    def __init__(self, robots: list[FakeRobot], seconds: Callable[[], float]) -> None:
        self.robots = robots
        self.seconds = seconds
        self.first_s = seconds() - 7200
        self.losses: list[tuple[float, float]] = []
        self.empty = False
        self.asked: list[str] = []

    def add_routes(self, app: FastAPI) -> None:
        """The routes of the contract's history."""
        root = "/api/v1/robots/{robot_id}"
        app.add_api_route(f"{root}/history", self._stored)
        app.add_api_route(f"{root}/timeline", self._timeline)
        app.add_api_route(f"{root}/at", self._at)
        app.add_api_route(f"{root}/messages", self._messages)
        app.add_api_route(f"{root}/metrics/range", self._range)
        app.add_api_route("/api/v1/export.mcap", self._export)

    def _robot(self, robot_id: str) -> FakeRobot:
        return next(robot for robot in self.robots if robot.id == robot_id)

    def _time(self, text: str) -> float:
        relative = re.fullmatch(r"-(\d+)([smhd])", text)
        if text == "now" or relative:
            return self.seconds() - (int(relative[1]) * RELATIVE[relative[2]] if relative else 0)
        return datetime.datetime.fromisoformat(text).timestamp()

    def _lost(self, at_s: float) -> bool:
        stored = self.first_s <= at_s <= self.seconds() and not self.empty
        return not stored or any(begin <= at_s <= end for begin, end in self.losses)

    def _stamps(self, start_s: float, end_s: float, rate_hz: float) -> Iterator[float]:
        """When something is stored of a topic that is kept at this rate."""
        for step in range(math.ceil(start_s * rate_hz), math.floor(end_s * rate_hz) + 1):
            if not self._lost(step / rate_hz):
                yield step / rate_hz

    def _gaps(self, start_s: float, end_s: float) -> list[dict[str, Any]]:
        touching = [(begin, end) for begin, end in self.losses if begin < end_s and end > start_s]
        common = {"reason": "outbox_full", "topic": None}
        return [
            {"from_ms": begin * 1000, "to_ms": end * 1000, "count": int(end - begin) * 6, **common}
            for begin, end in touching
        ]

    async def _stored(self, robot_id: str) -> dict[str, Any]:
        robot = self._robot(robot_id)
        span = {"first": None if self.empty else iso(self.first_s), "last": None if self.empty else iso(self.seconds())}
        topics = [
            {"topic": robot.topic(t.name), "type": t.type, "class": "bulk", "samples": 7200, "bytes": 1_000_000, **span}
            for t in robot.topics
            if t.name in KEPT_HZ and not self.empty
        ]
        return {"topics": topics, "series": 0 if self.empty else 8, **span}

    async def _timeline(self, robot_id: str, start: str, end: str, buckets: int = 240) -> dict[str, Any]:
        start_s, end_s = self._time(start), self._time(end)
        width = (end_s - start_s) / buckets
        middles = [start_s + (i + 0.5) * width for i in range(buckets)]
        robot = self._robot(robot_id)
        rows = [0 if self._lost(at) else int(12 * width) for at in middles]
        busy = [1 + 0.6 * math.sin(at / 97 + robot.phase) + 0.3 * math.sin(at / 23) for at in middles]
        counts = [0 if self._lost(at) else int(6 * width * part) for at, part in zip(middles, busy, strict=True)]
        head = {"start_ms": start_s * 1000, "end_ms": end_s * 1000, "width_ms": width * 1000}
        return {**head, "messages": counts, "rows": rows, "gaps": self._gaps(start_s, end_s)}

    async def _at(self, robot_id: str, t: str, topic: Names, max_age: str = "10s") -> Response:
        self.asked.append(f"at {t}")
        robot, at_s, age_s = self._robot(robot_id), self._time(t), float(max_age.rstrip("s"))
        known = {robot.topic(one.name): one for one in robot.topics}
        channels, missing, frame = [], [], b""
        for number, name in enumerate(topic, 1):
            one = known[name]
            kept = list(self._stamps(at_s - age_s, at_s, KEPT_HZ.get(one.name, 1)))
            if kept and one.name in KEPT_HZ:
                channels.append(robot.describe_channel(number, one))
                frame += _record(robot, number, one, kept[-1])
            else:
                before = [begin * 1000 for begin, end in self.losses if begin <= at_s <= end]
                nearest = before[0] if before else None
                missing.append({"topic": name, "reason": "too_old" if before else "not_stored", "nearest_ms": nearest})
        gaps = [gap | {"topic": name} for gap in self._gaps(at_s - age_s, at_s) for name in topic]
        head = json.dumps({"t_ms": at_s * 1000, "channels": channels, "missing": missing, "gaps": gaps}).encode()
        body = struct.pack("<I", len(head)) + head + frame
        return Response(body, media_type="application/x-metaros-records")

    async def _messages(self, robot_id: str, topic: Names, start: str, end: str, limit: int = 100) -> dict[str, Any]:
        robot = self._robot(robot_id)
        found = []
        for one in robot.topics:
            if robot.topic(one.name) in topic:
                for at_s in self._stamps(self._time(start), self._time(end), KEPT_HZ.get(one.name, 1)):
                    cdr = base64.b64encode(robot.stored(one, at_s)).decode()
                    row = {"topic": robot.topic(one.name), "type": one.type, "stamp": iso(at_s), "cdr": cdr}
                    found.append(row | {"stamp_ms": at_s * 1000, "seq": int(at_s), "epoch": "0", "class": "bulk"})
        return {"messages": found[:limit], "gaps": [], "next": None}

    async def _range(
        self, robot_id: str, name: Names, start: str, end: str = "now", points: int = 200
    ) -> dict[str, Any]:
        start_s, end_s = self._time(start), self._time(end)
        rate_hz = min(2.0, points / (end_s - start_s))
        robot = self._robot(robot_id)
        stamps = list(self._stamps(start_s, end_s, rate_hz))
        rows = [robot.metrics(at_s) for at_s in stamps]
        series: list[dict[str, Any]] = []
        for one in name:
            values = [row[one] for row in rows if one in row]
            columns = {"stamp_ms": [at * 1000 for at in stamps[: len(values)]], "mean": values, "min": values}
            series.append({"name": one, **columns, "max": values, "count": [1] * len(values)})
        gaps = [[g["from_ms"], g["to_ms"], g["count"], g["reason"]] for g in self._gaps(start_s, end_s)]
        return {"series": series, "gaps": gaps}

    async def _export(self) -> Response:
        self.asked.append("export")
        return Response(b"\x89MCAP0\r\n", headers={"content-disposition": 'attachment; filename="fake.mcap"'})


def _record(robot: FakeRobot, number: int, topic: FakeTopic, at_s: float) -> bytes:
    """The binary record of a stored message."""
    payload = robot.stored(topic, at_s)
    padded = -(-len(payload) // 8) * 8
    stamp_ns = int(at_s * 1e9)
    header = struct.pack("<IIIIQqq", 40 + padded, 0, number, len(payload), int(at_s * 10), stamp_ns, stamp_ns)
    return header + payload.ljust(padded, b"\0")
