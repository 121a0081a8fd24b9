"""The fake gateway's rules, hooks and schedules. Documents are read by the gateway's own code: faults are real."""

from __future__ import annotations

import copy
import datetime
from collections.abc import Callable
from typing import Any

from fastapi import FastAPI, Request
from fastapi.responses import JSONResponse, Response

from gateway.automation.rules.document import read_rule
from gateway.automation.rules.errors import RuleInvalidError
from gateway.domain.automation.rule import Maker
from metaros.automation.rules.errors import RuleTextError
from metaros.automation.rules.schedule import Schedule
from tests.e2e.fake.history import iso

__all__ = ["FakeRules"]

ADA = Maker(kind="user", id="U1", name="ada", role="admin", robots=("*",))
MAKER = {"name": "ada", "role": "admin", "robots": ["*"]}
BATTERY = {
    "name": "battery_low",
    "description": "A robot that runs low goes home",
    "enabled": True,
    "metric": {"series": "battery_state.percentage", "robots": ["sim_*"], "below": 0.2},
    "when": {"for": "30s", "cooldown": "10m"},
    "targets": [
        {"id": "dock", "kind": "function", "function": "dock_when_low", "qualifier": "live"},
        {"id": "slack", "kind": "webhook", "url": "https://hooks.example/T0/B1"}
        | {"transformer": {"paths": {"robot": "$.detail.robot"}, "template": {"text": "<robot> is low"}}},
    ],
}


class FakeRules:
    """Rules by name. `asked` is what browsers asked to be done."""

    def __init__(self, seconds: Callable[[], float]) -> None:
        self.seconds = seconds
        self.rows: dict[str, dict[str, Any]] = {}
        self.hooks: list[dict[str, Any]] = []
        self.firings: list[dict[str, Any]] = []
        self.asked: list[tuple[str, Any]] = []

    def add_routes(self, app: FastAPI) -> None:
        """The routes of the contract."""
        root = "/api/v1/rules"
        app.add_api_route(root, lambda: {"rules": list(self.rows.values()), "next": None})
        app.add_api_route(f"{root}/check", self._check, methods=["POST"])
        app.add_api_route(f"{root}/dry-run", self._dry_run, methods=["POST"])
        app.add_api_route(f"{root}/{{name}}", self._get)
        app.add_api_route(f"{root}/{{name}}", self._put, methods=["PUT"])
        app.add_api_route(f"{root}/{{name}}", self._remove, methods=["DELETE"], status_code=204)
        app.add_api_route(f"{root}/{{name}}/history", self._history)
        app.add_api_route(f"{root}/{{name}}/{{turn}}", self._turn, methods=["POST"])
        app.add_api_route(f"{root}/{{name}}/targets/{{target}}/secret", self._secret, methods=["POST"])
        app.add_api_route("/api/v1/schedules", self._schedules)
        app.add_api_route("/api/v1/schedules/preview", self._preview, methods=["POST"])
        app.add_api_route("/api/v1/hooks", lambda: {"hooks": self.hooks, "next": None})
        app.add_api_route("/api/v1/hooks", self._add_hook, methods=["POST"], status_code=201)
        app.add_api_route("/api/v1/hooks/{hook}/rotate", lambda hook: {"secret": "whsec_another"}, methods=["POST"])
        app.add_api_route("/api/v1/hooks/{hook}", self._remove_hook, methods=["DELETE"], status_code=204)

    def add(self, document: dict[str, Any], **stats: Any) -> dict[str, Any]:
        """A rule that did so much."""
        counted: dict[str, Any] = {"matched": 0, "fired": 0, "errors": 0, "last_fired": None, "last_error": ""}
        counted |= {"last_error_at": None, "groups": 0} | stats
        row = {"description": "", "enabled": True, "pattern": None, "until": None, "topic": None, "metric": None}
        row |= {"schedule": None, "when": None, "event_format": "eventbridge", "targets": []} | copy.deepcopy(document)
        row |= {"revision": 3, "changed": iso(self.seconds() - 86_400), "maker": MAKER, "stats": counted}
        row["next_fire"] = iso(self.seconds() + 3_720) if row["schedule"] else None
        self.rows[str(row["name"])] = row
        return row

    def world(self) -> None:
        """Four rules, a hook, and what a dry run finds."""
        now = self.seconds()
        self.add(BATTERY, matched=12_411, fired=38, last_fired=iso(now - 1260), groups=2)
        errors = {
            "name": "errors",
            "pattern": {"detail-type": ["metaros.alert.opened"], "detail": {"severity": ["error"]}},
        }
        errors["targets"] = [{"id": "page", "kind": "function", "function": "page_on_call"}]  # type: ignore[assignment]
        failed = "page: there is no function page_on_call"
        self.add(
            errors,
            matched=9,
            fired=9,
            errors=2,
            last_fired=iso(now - 240),
            last_error=failed,
            last_error_at=iso(now - 240),
        )
        night: dict[str, Any] = {"name": "every_night", "schedule": {"expression": "cron(0 3 * * ? *)"}}
        night["schedule"]["timezone"] = "Europe/Berlin"
        night["targets"] = [{"id": "report", "kind": "aws", "service": "sqs", "queue_url": "https://sqs.example/q"}]
        self.add(night, fired=31, matched=31, last_fired=iso(now - 54_000))
        bump: dict[str, Any] = {"name": "bumped", "enabled": False, "topic": {"topic": "/bumper", "robots": ["*"]}}
        bump["pattern"] = {"detail": {"message": {"pressed": [True]}}}
        bump["targets"] = [{"id": "clip", "kind": "capture", "last_s": 60}]
        self.add(bump, matched=3)
        self.add_hook("lift")
        for i in range(14):
            payload = {"text": f"sim_{1 + i % 3} is low"}
            firing: dict[str, Any] = {"at": iso(now - 3400 + 240 * i), "happening": f"sim_1/battery_low/{i}"}
            firing |= {"type": "metaros.metric.threshold", "robot": f"sim_{1 + i % 3}", "group": f"sim_{1 + i % 3}"}
            firing["targets"] = [{"id": "slack", "kind": "webhook", "payload": payload}]
            self.firings.append(firing)

    def add_hook(self, name: str, *, auth: str = "signature", robot: str = "", description: str = "") -> dict[str, Any]:
        """A hook that was used."""
        row: dict[str, Any] = {"name": name, "description": description, "auth": auth, "robot": robot}
        row |= {"path": f"/api/v1/hooks/{name}", "source": f"metaros.webhook/{name}", "type": "metaros.webhook"}
        row |= {
            "made": iso(self.seconds()),
            "made_by": "ada",
            "last_used": iso(self.seconds() - 90),
            "accepted": 412,
            "refused": 3,
        }
        self.hooks.append(row)
        return row

    async def _get(self, name: str) -> Any:
        detail = "there is no such rule"
        return self.rows.get(name) or JSONResponse({"code": "unknown_rule", "detail": detail, "status": 404}, 404)

    async def _check(self, body: dict[str, Any]) -> dict[str, Any]:
        try:
            read_rule(body, maker=ADA)
        except RuleInvalidError as error:
            return {"ok": False, "faults": [{"path": error.path, "message": error.fault}]}
        return {"ok": True, "faults": []}

    async def _put(self, name: str, body: dict[str, Any], request: Request) -> Any:
        self.asked.append((f"put {name} {request.headers['if-match']}", body))
        before = self.rows.get(name)
        if request.headers["if-match"] != f'"{before["revision"] if before else 0}"':
            return JSONResponse({"code": "revision_conflict", "detail": "it was changed meanwhile", "status": 412}, 412)
        made = self.add(body)
        made["revision"] = before["revision"] + 1 if before else 1
        return made

    async def _remove(self, name: str) -> Response:
        del self.rows[name]
        return Response(status_code=204)

    async def _turn(self, name: str, turn: str) -> dict[str, Any]:
        self.asked.append((f"{turn} {name}", None))
        self.rows[name]["enabled"] = turn == "enable"
        return self.rows[name]

    async def _secret(self, name: str, target: str) -> dict[str, str]:
        self.asked.append((f"secret {name}/{target}", None))
        return {"secret": "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"}

    async def _history(self, name: str) -> dict[str, Any]:
        common = {"by": "ada", "document": {"name": name}}
        rows = [{"revision": 3, "what": "changed", "at": iso(self.seconds() - 86_400)} | common]
        return {
            "entries": [*rows, {"revision": 1, "what": "created", "at": iso(self.seconds() - 99_000)} | common],
            "next": None,
        }

    async def _dry_run(self, body: dict[str, Any]) -> dict[str, Any]:
        self.asked.append(("dry-run", body))
        count = len(self.firings)
        found = {"scanned": 4211, "matched": 60, "fired": count, "errors": 0, "error": "", "truncated": False}
        return found | {"firings": self.firings}

    async def _schedules(self) -> dict[str, Any]:
        rows = [row for row in self.rows.values() if row["schedule"]]
        return {"schedules": [self._schedule(row) for row in rows], "next": None}

    def _schedule(self, row: dict[str, Any]) -> dict[str, Any]:
        said = {"timezone": "UTC", "misfire": "skip"} | row["schedule"]
        return said | {"rule": row["name"], "enabled": row["enabled"], "next": row["next_fire"], "last": None}

    async def _preview(self, body: dict[str, Any]) -> Any:
        try:
            schedule = Schedule.parse(body["expression"], body["timezone"])
        except RuleTextError as error:
            return JSONResponse({"code": "schedule_invalid", "detail": str(error), "status": 400}, 400)
        times: list[str] = []
        at_ns: int | None = round(self.seconds() * 1e9)
        for _ in range(body["count"]):
            at_ns = schedule.next_after(at_ns) if at_ns is not None else None
            if at_ns is not None:
                times.append(datetime.datetime.fromtimestamp(at_ns / 1e9, datetime.UTC).isoformat())
        return {"times": times}

    async def _add_hook(self, body: dict[str, Any]) -> dict[str, Any]:
        return self.add_hook(**body) | {"secret": "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw"}

    async def _remove_hook(self, hook: str) -> Response:
        self.hooks = [row for row in self.hooks if row["name"] != hook]
        return Response(status_code=204)
