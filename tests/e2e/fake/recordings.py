"""The fake gateway's recordings and store: clips that come as far as the test lets them, and figures of storage."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from typing import Any

from fastapi import FastAPI
from fastapi.responses import JSONResponse, Response

from tests.e2e.fake.history import iso

__all__ = ["FakeRecordings"]

FULL_BYTES = 48_300_000


class FakeRecordings:
    """Recordings by id; a test moves them on by changing them."""

    def __init__(self, seconds: Callable[[], float]) -> None:
        self.seconds = seconds
        self.rows: list[dict[str, Any]] = []
        self.damaged: list[dict[str, Any]] = []
        self.refuses = ""

    def add_routes(self, app: FastAPI) -> None:
        """The routes of the contract's recordings and store."""
        app.add_api_route("/api/v1/robots/{robot_id}/recordings", self._save, methods=["POST"], status_code=202)
        app.add_api_route("/api/v1/recordings", self._list)
        app.add_api_route("/api/v1/recordings/{number}", self._delete, methods=["DELETE"], status_code=204)
        app.add_api_route("/api/v1/recordings/{number}/file.mcap", self._file)
        app.add_api_route("/api/v1/store", self._store)

    def add(self, robot: str, start_s: float, end_s: float, state: str = "requested", **more: Any) -> dict[str, Any]:
        """A recording of a span, in a state."""
        row = {"id": f"01REC{len(self.rows)}", "robot": robot, "state": state, "start": iso(start_s), "end": iso(end_s)}
        row |= {"requested": iso(self.seconds()), "size_bytes": None, "received_bytes": None, "messages": None}
        row |= {"code": None, "message": None}
        if state in ("transferring", "stored"):
            row |= {"size_bytes": FULL_BYTES, "messages": 6210, "received_bytes": FULL_BYTES}
        self.rows.insert(0, row | more)
        return self.rows[0]

    async def _save(self, robot_id: str, body: dict[str, Any]) -> Any:
        if self.refuses:
            return JSONResponse({"code": "unsupported", "detail": self.refuses, "status": 501}, 501)
        now = self.seconds()
        if "last_s" in body:
            return self.add(robot_id, now - body["last_s"], now)
        start, end = (datetime.datetime.fromisoformat(body[key]).timestamp() for key in ("start", "end"))
        return self.add(robot_id, start, end)

    async def _list(self, robot: str = "") -> dict[str, Any]:
        return {"recordings": [row for row in self.rows if robot in ("", row["robot"])]}

    async def _delete(self, number: str) -> Response:
        self.rows = [row for row in self.rows if row["id"] != number]
        return Response(status_code=204)

    async def _file(self, number: str) -> Response:
        return Response(b"\x89MCAP0\r\n", media_type="application/octet-stream")

    async def _store(self) -> dict[str, Any]:
        oldest = iso(self.seconds() - 12 * 86400)
        sizes = {"event": 4_100_000, "metric": 212_000_000, "bulk": 3_870_000_000, "recording": 410_000_000}
        days = {"event": 90, "metric": 30, "bulk": 7, "recording": None}
        classes = [
            {"class": name, "bytes": size, "oldest": oldest, "keep_days": days[name], "keep_bytes": None}
            for name, size in sizes.items()
        ]
        head = {"total_bytes": sum(sizes.values()), "disk_free_bytes": 38_000_000_000, "classes": classes}
        head |= {
            "growth_bytes_per_day": 410_000_000,
            "days_until_bound": None,
            "days_until_full": 92.6,
            "robots": [],
            "keep_bytes": None,
            "damaged": self.damaged,
        }
        return head
