"""The fake gateway's functions: what is called and how it does, their calls, logs, code, dead letters and canaries."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import AsyncIterator, Callable
from typing import Annotated, Any

from fastapi import FastAPI, Query, Request
from fastapi.responses import JSONResponse, Response, StreamingResponse

from tests.e2e.fake.history import iso

__all__ = ["CODE", "FakeFunctions"]

Words = Annotated[list[str], Query(alias="id")]
POLL_S = 0.05
EVENT_STREAM = "text/event-stream"
ARN = "arn:aws:lambda:local:000000000000:function:"
CODE = '''"""Sends a robot to its dock when its battery is low."""

import os

LEAST = float(os.environ.get("LEAST", 0.2))


def handler(event, context):
    detail = event["detail"]
    if detail["value"] > LEAST:
        return {"docked": False}
    print("docking", detail["robot"])  # the rule's command follows
    return {"docked": True, "robot": detail["robot"]}
'''
RUNTIME = {
    "on": True,
    "started": True,
    "trouble": "",
    "level": "L3",
    "require": "L2",
    "reasons": {"L3": "ok", "L2": "ok", "L1": "ok", "L0": "ok"},
    "entry": "awslambdaric",
    "interpreter": "python3.11.9",
    "runtimes": ["python3.*"],
    "workers": 3,
    "most_workers": 8,
    "memory_mb": 96,
    "pools": [
        {"function": "dock_when_low", "version": "2", "entry": "awslambdaric", "workers": 2, "busy": 1, "starting": 0}
        | {"waiting": 0, "calls": 4211, "cold_starts": 3, "failures": 12, "memory_mb": 63, "init_error": ""},
        {"function": "page_on_call", "version": "$LATEST", "entry": "metaros", "workers": 1, "busy": 0, "starting": 0}
        | {"waiting": 2, "calls": 96, "cold_starts": 9, "failures": 9, "memory_mb": 33}
        | {"init_error": "ModuleNotFoundError: No module named 'requests'"},
    ],
}
NO_FUNCTION = {"code": "unknown_function", "detail": "there is no such function", "status": 404}


class FakeFunctions:
    """Functions by name. `asked` is what browsers asked to be done; `refuses` is why the next is refused."""

    def __init__(self, seconds: Callable[[], float]) -> None:
        self.seconds = seconds
        self.rows: dict[str, dict[str, Any]] = {}
        self.calls: list[dict[str, Any]] = []
        self.lines: list[dict[str, Any]] = []
        self.dead: list[dict[str, Any]] = []
        self.runtime: dict[str, Any] = {**RUNTIME}
        self.asked: list[tuple[str, Any]] = []
        self.refuses = ""
        self.answer: dict[str, Any] = {"status": "ok", "payload": {"docked": True, "robot": "sim_1"}}

    def add_routes(self, app: FastAPI) -> None:
        """The routes of the contract."""
        root = "/api/v1/functions"
        app.add_api_route("/api/v1/functions-runtime", lambda: self.runtime)
        app.add_api_route(root, lambda: {"functions": list(self.rows.values()), "next": None})
        app.add_api_route(f"{root}/{{name}}", self._get)
        app.add_api_route(f"{root}/{{name}}", self._set, methods=["PUT"])
        app.add_api_route(f"{root}/{{name}}", self._remove, methods=["DELETE"], status_code=204)
        app.add_api_route(f"{root}/{{name}}/invoke", self._invoke, methods=["POST"])
        app.add_api_route(f"{root}/{{name}}/invocations", self._calls)
        app.add_api_route(f"{root}/{{name}}/logs", self._logs, response_model=None)
        app.add_api_route(f"{root}/{{name}}/code", self._code)
        app.add_api_route(f"{root}/{{name}}/code", self._upload, methods=["PUT"])
        app.add_api_route(f"{root}/{{name}}/code/text", self._text)
        app.add_api_route(f"{root}/{{name}}/versions", self._publish, methods=["POST"])
        app.add_api_route(f"{root}/{{name}}/aliases/{{alias}}", self._alias, methods=["PUT"])
        app.add_api_route(f"{root}/{{name}}/aliases/{{alias}}/canary", self._canary, methods=["PUT"])
        app.add_api_route(f"{root}/{{name}}/aliases/{{alias}}/canary", self._stop_canary, methods=["DELETE"])
        app.add_api_route("/api/v1/dead-letters", self._dead)
        app.add_api_route("/api/v1/dead-letters", self._drop, methods=["DELETE"])
        app.add_api_route("/api/v1/dead-letters/redrive", self._redrive, methods=["POST"])
        app.add_api_route("/api/v1/dead-letters/{letter}", self._letter)

    def add(self, name: str, *, rate: float = 0.0, failing: float = 0.0, **more: Any) -> dict[str, Any]:
        """A function that was called about so often a minute in the last hour."""
        now, series = self.seconds(), []
        for i in range(60):
            count = round(rate * (1 + 0.6 * math.sin(i / 6) + 0.3 * math.sin(i * 1.7)))
            errors = round(count * failing) if i > 40 else 0
            took = 4.0 + math.sin(i / 4) + (9.0 if errors else 0.0) if count else None
            minute = {"at": iso((now // 60 - 59 + i) * 60), "invocations": count, "errors": errors}
            series.append(minute | {"throttles": 2 if count and i == 33 else 0, "p95_ms": took})
        total, errors = sum(row["invocations"] for row in series), sum(row["errors"] for row in series)
        stats = {"window_s": 3600.0, "invocations": total, "errors": errors, "throttles": 2 if rate else 0}
        stats |= {"cold_starts": 3 if total else 0, "running": 1 if total else 0, "p50_ms": 2.8 if total else None}
        stats |= {"p95_ms": 13.7 if total else None, "p99_ms": 84.0 if total else None, "iterator_age_s": None}
        stats |= {"waiting": 0, "dead_letters": 0, "series": series if total else []}
        row: dict[str, Any] = {"name": name, "arn": ARN + name, "description": "", "runtime": "python3.12"}
        row |= {"interpreter": "python3.11.9", "handler": "dock.handler", "state": "Active", "reason": ""}
        row |= {"timeout_s": 3, "memory_mb": 128, "disk_mb": 512, "code_sha256": "q83v", "code_bytes": 1_240}
        row |= {"modified": iso(now - 7200), "versions": 0, "aliases": [], "triggers": []}
        row |= {"concurrency": {"reserved": None, "warm": 0}, "stats": stats, "environment": {}, "layers": []}
        row |= {"published": [], "mappings": [], "url": None}
        row["event_invoke"] = {"most_retries": 2, "most_age_s": 21600, "on_success": "", "on_failure": ""}
        row["event_invoke"]["dead_letter"] = ""
        self.rows[name] = row | more
        return self.rows[name]

    def world(self) -> dict[str, Any]:
        """Four functions: one that is busy with a canary, one that fails, one of a topic, one that nothing calls."""
        now = self.seconds()
        dock = self.add("dock_when_low", rate=70, description="Sends a robot to its dock when its battery is low")
        dock["triggers"] = [
            {"kind": "rule", "id": "battery_low", "title": "battery_low", "enabled": True},
            {"kind": "schedule", "id": "every_night", "title": "every_night", "enabled": False},
        ]
        dock["published"] = [
            {"version": "1", "description": "the first", "code_sha256": "AAAA", "modified": iso(now - 200_000)},
            {"version": "2", "description": "asks the map first", "code_sha256": "q83v", "modified": iso(now - 7200)},
        ]
        dock |= {"versions": 2, "environment": {"LEAST": "0.2", "DOCK_TOPIC": "/dock"}}
        dock["concurrency"] = {"reserved": 4, "warm": 2}
        dock["aliases"] = [
            {"name": "live", "version": "1", "description": "", "weights": {"2": 0.1}, "canary": self.canary("2")}
        ]
        page = self.add("page_on_call", rate=3, failing=0.5, description="Tells who is on call of errors")
        page["triggers"] = [{"kind": "rule", "id": "errors", "title": "errors", "enabled": True}]
        images = self.add("image_to_s3", rate=20, description="Keeps one image a minute")
        arn = "arn:aws:metaros:::topic/sim_*/camera/image"
        images["triggers"] = [{"kind": "mapping", "id": "m1", "title": arn, "enabled": True}]
        images["stats"]["iterator_age_s"] = 1.2
        self.add("try_me", handler="try_me.handler")
        for i in range(7):
            self.die("page_on_call", f"01DEAD{i}", ago_s=60 + 400 * i)
        for i in range(24):
            self.call(
                "dock_when_low",
                ago_s=12 + 35 * i,
                status=("error", "ok", "ok", "timeout")[i % 12 % 4] if i < 9 else "ok",
            )
        for text in ("START RequestId: r-1 Version: 2", "docking sim_2", "END RequestId: r-1"):
            self.say(text)
        self.say(
            "REPORT RequestId: r-1 Duration: 2.31 ms Billed Duration: 3 ms Memory Size: 128 MB Max Memory Used: 31 MB"
        )
        return dock

    def canary(self, version: str, **more: Any) -> dict[str, Any]:
        """One that runs."""
        at = iso(self.seconds() - 300)
        row: dict[str, Any] = {"version": version, "stable": "1", "weight": 0.1, "error_rate": 0.05}
        row |= {"least_invocations": 20, "for_s": 600.0, "step": 0.0, "state": "running", "reason": "", "began": at}
        return row | {"changed": at, "invocations": 212, "errors": 3} | more

    def call(self, name: str, *, ago_s: float, status: str = "ok", **more: Any) -> None:
        """A call that is over."""
        number = len(self.calls)
        row: dict[str, Any] = {"id": f"01CALL{number:04}", "request_id": f"8f6c2f1e-{number:04}-4b1d", "function": name}
        row |= {"version": "2", "qualifier": "live", "kind": "event", "robot": "sim_2", "status": status}
        row |= {"error_type": "", "error_message": "", "began": iso(self.seconds() - ago_s), "duration_ms": 2.31}
        row |= {"init_ms": 48.2 if number == 5 else 0.0, "max_memory_mb": 31, "log": "START …\ndocking sim_2\nEND …"}
        if status == "error":
            row |= {"error_type": "KeyError", "error_message": "'value'", "log": "Traceback …\nKeyError: 'value'"}
        if status == "timeout":
            row |= {"error_type": "Sandbox.Timeout", "error_message": "Task timed out after 3.00 seconds"}
            row["duration_ms"] = 3000.0
        self.calls.append(row | more)

    def say(self, text: str, *, request: str = "r-1") -> None:
        """A line of the log."""
        line = {"cursor": len(self.lines) + 1, "at": iso(self.seconds()), "request_id": request, "version": "2"}
        self.lines.append(line | {"text": text})

    def die(self, target: str, number: str, *, ago_s: float, kind: str = "function") -> None:
        """A dead letter."""
        now = self.seconds()
        row = {"id": number, "kind": kind, "target": target, "happening": "e-4711", "robot": "sim_2"}
        row |= {"code": "function_error", "message": "ModuleNotFoundError: No module named 'requests'", "attempts": 3}
        row |= {"tries": 3, "redrives": 0, "born": iso(now - ago_s - 180), "ended": iso(now - ago_s)}
        self.dead.append(row | {"payload": json.dumps({"detail": {"robot": "sim_2"}}), "truncated": False})
        if target in self.rows:
            self.rows[target]["stats"]["dead_letters"] += 1

    async def _get(self, name: str) -> Any:
        return self.rows.get(name) or JSONResponse(NO_FUNCTION, 404)

    async def _set(self, name: str, body: dict[str, Any]) -> Any:
        self.asked.append((f"set {name}", body))
        if self.refuses:
            return self._refused()
        self.rows[name] |= {
            key: body[key] for key in ("timeout_s", "memory_mb", "description", "handler") if key in body
        }
        self.rows[name]["environment"] = body.get("environment", self.rows[name]["environment"])
        return self.rows[name]

    async def _remove(self, name: str) -> Response:
        self.asked.append((f"remove {name}", None))
        del self.rows[name]
        return Response(status_code=204)

    async def _invoke(self, name: str, request: Request, qualifier: str = "", kind: str = "request") -> Any:
        text = (await request.body()).decode()
        self.asked.append((f"invoke {name}:{qualifier} {kind}", text))
        if self.refuses:
            return self._refused()
        if kind == "event":
            return JSONResponse({"request_id": "r-9", "status": "accepted"}, 202)
        took = {"request_id": "r-8", "version": qualifier or "$LATEST", "duration_ms": 2.4, "init_ms": 51.0}
        return took | {"error_type": "", "max_memory_mb": 31, "log": "docking sim_1\n"} | self.answer

    async def _calls(self, name: str, status: str = "", robot: str = "", limit: int = 100) -> dict[str, Any]:
        rows = [row for row in self.calls if row["function"] == name and status in ("", row["status"])]
        return {"invocations": [row for row in rows if robot in ("", row["robot"])][:limit], "next": None}

    async def _logs(self, request: Request, after: int = 0) -> Any:
        if EVENT_STREAM not in request.headers.get("accept", ""):
            return {"lines": self.lines[-200:], "next": None}
        return StreamingResponse(self._tail(after), media_type=EVENT_STREAM)

    async def _tail(self, after: int) -> AsyncIterator[str]:
        yield "retry: 100\n\n"
        while True:
            for line in self.lines[after:]:
                yield f"id: {line['cursor']}\ndata: {json.dumps(line)}\n\n"
            after = len(self.lines)
            await asyncio.sleep(POLL_S)

    async def _code(self, version: str = "$LATEST") -> dict[str, Any]:
        files = [{"path": "dock.py", "size_bytes": len(CODE)}, {"path": "lib/maps.json", "size_bytes": 23}]
        return {"version": version, "files": files, "truncated": False}

    async def _text(self, path: str) -> dict[str, Any]:
        return {"path": path, "text": CODE if path == "dock.py" else '{"map": "hall", "n": 3}', "truncated": False}

    async def _upload(
        self, name: str, request: Request, handler: str = "", publish: bool = False, alias: str = ""
    ) -> Any:
        self.asked.append((f"upload {name}", {"handler": handler, "publish": publish, "alias": alias}))
        size = len(await request.body())
        if self.refuses:
            return self._refused()
        row = self.rows.get(name) or self.add(name)
        row |= {"code_bytes": size, "handler": handler or row["handler"]}
        return row

    async def _publish(self, name: str, body: dict[str, Any]) -> dict[str, Any]:
        published = self.rows[name]["published"]
        made = {"version": str(len(published) + 1), "code_sha256": "q83v", "modified": iso(self.seconds())}
        published.append(made | {"description": body.get("description", "")})
        return dict(published[-1])

    async def _alias(self, name: str, alias: str, body: dict[str, Any]) -> dict[str, Any]:
        self.asked.append((f"alias {name}:{alias}", body))
        row = {"name": alias, "description": "", "canary": None, "version": body["version"], "weights": body["weights"]}
        others = [one for one in self.rows[name]["aliases"] if one["name"] != alias]
        self.rows[name]["aliases"] = [*others, row]
        return row

    async def _canary(self, name: str, alias: str, body: dict[str, Any]) -> dict[str, Any]:
        self.asked.append((f"canary {name}:{alias}", body))
        row = next(one for one in self.rows[name]["aliases"] if one["name"] == alias)
        row |= {"weights": {body["version"]: body["weight"]}}
        row["canary"] = self.canary(body["version"], weight=body["weight"], invocations=0, errors=0)
        return dict(row["canary"])

    async def _stop_canary(self, name: str, alias: str) -> dict[str, Any]:
        row = next(one for one in self.rows[name]["aliases"] if one["name"] == alias)
        row["weights"] = {}
        row["canary"] |= {"state": "cancelled", "reason": ""}
        return dict(row["canary"])

    async def _dead(self, kind: str = "", target: str = "") -> dict[str, Any]:
        rows = [one for one in self.dead if kind in ("", one["kind"]) and target in ("", one["target"])]
        return {"dead_letters": [one | {"payload": None} for one in rows], "total": len(rows), "next": None}

    async def _letter(self, letter: str) -> Any:
        return next(one for one in self.dead if one["id"] == letter)

    async def _redrive(self, body: dict[str, Any]) -> dict[str, int]:
        self.asked.append(("redrive", body))
        return {"redriven": self._take(body.get("ids", []), body.get("target", ""), body.get("all", False))}

    async def _drop(
        self,
        number: Words = [],  # noqa: B006
        target: str = "",
        all: bool = False,  # noqa: A002
    ) -> dict[str, int]:
        self.asked.append(("drop", {"ids": number, "target": target, "all": all}))
        return {"dropped": self._take(number, target, all)}

    def _take(self, ids: list[str], target: str, everything: bool) -> int:
        gone = [one for one in self.dead if everything or one["id"] in ids or (target and one["target"] == target)]
        self.dead = [one for one in self.dead if one not in gone]
        for one in gone:
            if one["target"] in self.rows:
                self.rows[one["target"]]["stats"]["dead_letters"] -= 1
        return len(gone)

    def _refused(self) -> JSONResponse:
        return JSONResponse({"code": "refused", "detail": self.refuses, "status": 400}, 400)
