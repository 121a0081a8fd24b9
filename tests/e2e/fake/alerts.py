"""The fake gateway's alerts: rows that a test adds and people change, silences, checks, bands, and their events."""

from __future__ import annotations

import asyncio
import datetime
import json
import math
from collections.abc import AsyncIterator, Callable
from typing import Annotated, Any

from fastapi import FastAPI, Query
from fastapi.responses import JSONResponse, StreamingResponse

from tests.e2e.fake.history import iso
from tests.e2e.fake.recordings import FakeRecordings
from tests.e2e.fake.robots import FakeRobot

__all__ = ["FakeAlerts"]

Words = Annotated[list[str], Query()]
HOT = "motor_temperature.temperature"
POLL_S = 0.05
BY = "ada"


def _check(name: str, title: str, **more: Any) -> dict[str, Any]:
    row = {"id": name, "title": title, "unit": "", "enabled": True, "low": None, "high": None, "for_s": 5.0}
    row |= {"clear_s": 30.0, "severity": "warning", "changed": [], "changed_by": "", "changed_at": None}
    return row | more


CHECKS = (
    _check("offline", "Robot is offline", unit="s", for_s=30.0, clear_s=5.0, severity="error"),
    _check("cpu", "CPU is busy", unit="%", high=95.0, for_s=300.0, clear_s=60.0),
    _check("battery_low", "Battery is low", low=0.2, for_s=10.0),
    _check("motor_hot", "Motor is hot", unit="°C", high=80.0, changed=["high"], changed_by="eve"),
    _check("novelty", "Value never seen before", for_s=0.0, severity="info", enabled=False),
)


class FakeAlerts:
    """Alerts by id, the newest first. `changed` counts what a browser is told of by events."""

    def __init__(self, robots: list[FakeRobot], recordings: FakeRecordings, seconds: Callable[[], float]) -> None:
        self.robots, self.recordings, self.seconds = robots, recordings, seconds
        self.rows: list[dict[str, Any]] = []
        self.silences: list[dict[str, Any]] = []
        self.checks = [dict(row) for row in CHECKS]
        self.asked: list[tuple[str, Any]] = []
        self.refuses = ""
        self.remembers = True
        self.changed = 0

    def add_routes(self, app: FastAPI) -> None:
        """The routes of the contract's alerts, silences, checks and what is watched; and the stream of events."""
        root = "/api/v1/alerts"
        app.add_api_route(root, self._list)
        app.add_api_route(f"{root}/{{number}}", self._get)
        app.add_api_route(f"{root}/{{number}}/{{what}}", self._act, methods=["POST"])
        app.add_api_route("/api/v1/silences", lambda: {"silences": self.silences, "next": None})
        app.add_api_route("/api/v1/silences", self._add_silence, methods=["POST"], status_code=201)
        app.add_api_route("/api/v1/silences/{number}", self._end_silence, methods=["DELETE"])
        app.add_api_route("/api/v1/alert-checks", lambda: {"checks": self.checks, "next": None})
        app.add_api_route("/api/v1/alert-checks/{name}", self._set_check, methods=["PUT"])
        app.add_api_route("/api/v1/alert-checks/{name}", self._reset_check, methods=["DELETE"])
        app.add_api_route("/api/v1/robots/{robot_id}/watch", self._watch)
        app.add_api_route("/api/v1/robots/{robot_id}/watch/band", self._band)
        app.add_api_route("/api/v1/events", self._events)

    def add(self, robot: str, first_s: float, *, until_s: float | None = None, **more: Any) -> dict[str, Any]:
        """An alert that began then, and goes on unless it ended."""
        at = iso(first_s)
        row: dict[str, Any] = {"id": f"01ALERT{len(self.rows)}", "robot": robot, "cause": "heat", "state": "open"}
        row |= {"severity": "warning", "title": "Too hot", "reason": "", "series": "", "detector": "motor_hot"}
        row |= {"score": 0.8, "value": None, "low": None, "high": None, "first": at, "opened": iso(first_s + 4)}
        row |= {"changed": at, "seen": at, "clearing": None, "resolved": None, "resolved_by": ""}
        row |= {"acknowledged": None, "acknowledged_by": "", "assignee": "", "times": 1, "clip": ""}
        row |= {"inhibited_by": "", "silence": "", "quiet": False, "gateway": "gw_1", "revision": 1}
        row |= {"path": f"/robots/{robot}?t={at.replace('+00:00', 'Z')}&span=15m", "findings": [], "remarks": []}
        if until_s is not None:
            row |= {"state": "resolved", "resolved": iso(until_s)}
        row |= more
        self.rows.insert(0, row)
        self.rows.sort(key=lambda one: str(one["opened"]), reverse=True)
        self.tell(robot)
        return row

    def tell(self, robot: str) -> None:
        """Count the robot's open alerts anew, and tell browsers that something changed."""
        reported = [
            row for row in self.rows if row["robot"] == robot and row["state"] != "resolved" and not row["quiet"]
        ]
        counts = {word: sum(row["severity"] == word for row in reported) for word in ("error", "warning")}
        for one in self.robots:
            if one.id == robot:
                one.alerts = {"open": len(reported), **counts}
        self.changed += 1

    def heat(self, robot: FakeRobot, *, ago_s: float = 240.0, **more: Any) -> dict[str, Any]:
        """A motor that has been getting hot, as the watch tells of it: two findings of one cause."""
        first_s = self.seconds() - ago_s
        robot.hot_from_s = first_s - 20
        fields: dict[str, Any] = {"severity": "error", "title": "Too hot", "series": HOT, "detector": "motor_overheats"}
        fields |= {
            "reason": "Motor temperature is 96.4 °C; a motor overheats above 95 °C, and this one was never above 43 °C."
        }
        fields |= {"value": 96.4, "low": 39.1, "high": 43.2, "score": 0.97}
        row = self.add(robot.id, first_s, **fields | more)
        common = {"series": HOT, "at": row["first"], "active": True}
        jump = "Motor temperature is higher than in all of the 3 h that were learned."
        row["findings"] = [
            {**common, "detector": "motor_overheats", "severity": "error", "score": 0.97, "value": 96.4, "low": None}
            | {"high": 95.0, "reason": "Motor temperature is above 95 °C for 2 s."},
            {**common, "detector": "level", "severity": "warning", "score": 0.81, "value": 71.0, "low": 39.1}
            | {"high": 43.2, "reason": jump},
            {**common, "detector": "motor_rise", "severity": "warning", "score": 0.6, "value": 0.9, "low": None}
            | {"high": 0.6, "reason": "Motor temperature rises by 0.9 °C/s.", "active": False},
        ]
        return row

    def _row(self, number: str) -> dict[str, Any] | None:
        return next((row for row in self.rows if row["id"] == number), None)

    async def _list(self, robot: Words = [], until: str = "", limit: int = 100) -> dict[str, Any]:  # noqa: B006
        before = datetime.datetime.fromisoformat(until) if until else None
        rows = [
            {name: value for name, value in row.items() if name not in ("findings", "remarks")}
            for row in self.rows
            if (not robot or row["robot"] in robot)
            and (before is None or datetime.datetime.fromisoformat(row["opened"]) < before)
        ]
        return {"alerts": rows[:limit], "next": rows[limit - 1]["id"] if len(rows) > limit else None}

    async def _get(self, number: str) -> Any:
        row = self._row(number)
        detail = "there is no such alert, or none of a robot that you may see"
        return row or JSONResponse({"code": "unknown_alert", "detail": detail, "status": 404}, 404)

    async def _act(self, number: str, what: str, body: dict[str, Any]) -> Any:
        row = self._row(number)
        self.asked.append((what, body))
        if row is None or self.refuses:
            return JSONResponse({"code": "alert_state", "detail": self.refuses, "status": 409}, 409)
        now = iso(self.seconds())
        text = body.get("text", body.get("assignee", ""))
        remark = {"number": len(row["remarks"]) + 1, "at": now, "by": BY, "kind": f"{what}d", "text": text}
        answer: Any = row
        if what == "acknowledge":
            row |= {"state": "acknowledged", "acknowledged": now, "acknowledged_by": BY}
        elif what == "unacknowledge":
            row |= {"state": "open", "acknowledged": None, "acknowledged_by": ""}
        elif what == "resolve":
            row |= {"state": "resolved", "resolved": now, "resolved_by": BY}
        elif what == "assign":
            row["assignee"] = text
            remark["kind"] = "assigned"
        elif what == "comments":
            remark["kind"] = "comment"
        elif what == "normal":
            remark["kind"] = "normal"
            answer = {"alert": row, "taught": [f"{row['series']} of {row['robot']} may be 96.4."]}
        elif what == "clip":
            first_s = datetime.datetime.fromisoformat(row["first"]).timestamp()
            answer = self.recordings.add(row["robot"], first_s - 30, first_s + 10)
            row["clip"] = answer["id"]
            remark |= {"kind": "clip", "text": ""}
        else:
            answer = await self._add_silence(
                {"robots": [row["robot"]], "causes": [row["cause"]], "up_to": "error", **body}
            )
            row |= {"silence": answer["id"], "quiet": True}
        if what != "silence":
            row["remarks"].append(remark)
        row["revision"] += 1
        self.tell(row["robot"])
        return answer

    async def _add_silence(self, body: dict[str, Any]) -> dict[str, Any]:
        self.asked.append(("silences", body))
        now = self.seconds()
        span = {"from": iso(now), "until": iso(now + body.pop("for_s"))}
        self.silences.insert(0, {"id": f"01SILENCE{len(self.silences)}", **body, **span, "by": BY})
        self.changed += 1
        return self.silences[0]

    async def _end_silence(self, number: str) -> dict[str, Any]:
        (ended,) = (one for one in self.silences if one["id"] == number)
        self.silences.remove(ended)
        for row in self.rows:
            if row["silence"] == number:
                row |= {"silence": "", "quiet": False}
                self.tell(row["robot"])
        return ended

    async def _set_check(self, name: str, body: dict[str, Any]) -> dict[str, Any]:
        self.asked.append((f"check {name}", body))
        (row,) = (one for one in self.checks if one["id"] == name)
        row |= {**body, "changed": sorted({*row["changed"], *body}), "changed_by": BY}
        return row

    async def _reset_check(self, name: str) -> dict[str, Any]:
        (row,) = (one for one in self.checks if one["id"] == name)
        (original,) = (one for one in CHECKS if one["id"] == name)
        row |= {**original, "changed": [], "changed_by": ""}
        return row

    async def _watch(self, robot_id: str) -> dict[str, Any]:
        robot = next(one for one in self.robots if one.id == robot_id)
        names = sorted(robot.metrics(0.0))
        rows = [{"series": name, "seen": 12_400, "of": 750, "score": 0.02, "low": -1.0, "high": 1.0} for name in names]
        for row in rows:
            if row["series"] == HOT:
                row |= {"score": 0.97 if robot.hot_from_s else 0.01, "low": 39.1, "high": 43.2}
            if row["series"] == "host.cpu.percent":
                row |= {"seen": 62, "score": 0.0, "low": None, "high": None}
        return {"series": rows, "next": None}

    async def _band(
        self, robot_id: str, series: str, from_: Annotated[str, Query(alias="from")], to: str
    ) -> dict[str, Any]:
        robot = next(one for one in self.robots if one.id == robot_id)
        start_s, end_s = (datetime.datetime.fromisoformat(text).timestamp() for text in (from_, to))
        points: list[list[float | None]] = []
        step_s = max(1.0, (end_s - start_s) / 600)
        at_s = math.ceil(start_s)
        while at_s < end_s and self.remembers:
            value = robot.metrics(at_s)[series]
            low, high = 40.4 + math.sin(at_s / 9) - 1.3, 41.6 + math.sin(at_s / 9) + 1.1
            far = max(low - value, value - high, 0.0)
            points.append([at_s * 1000, value, low, high, min(1.0, far / 12)])
            at_s += step_s
        return {"robot": robot_id, "series": series, "points": points}

    async def _events(self, kind: str = "*") -> StreamingResponse:
        self.asked.append(("events", kind))
        return StreamingResponse(self._reported(), media_type="text/event-stream")

    async def _reported(self) -> AsyncIterator[bytes]:
        yield b"retry: 2000\n\n"
        seen = self.changed
        while True:
            await asyncio.sleep(POLL_S)
            if seen != self.changed:
                seen = self.changed
                yield f"id: {seen}\ndata: {json.dumps({'type': 'metaros.alert.changed'})}\n\n".encode()
