"""Backtests over HTTP: stored rows judged again, for who may, and only of robots in scope."""

from __future__ import annotations

from contextlib import AsyncExitStack
from pathlib import Path
from typing import Any

import httpx

from gateway.api.models import watch
from gateway.domain.principal import Role
from metaros._proto import link_pb2
from metaros.clock import SystemClock
from tests.gateway.harness import DATA, RING, ScriptedAgent, client, running_gateway

PATH = "/api/v1/backtests"
SCOPED = RING.add(role=Role.OPERATOR, robots=("lab_*",), name="lab operator")
VIEWER = RING.add(role=Role.VIEWER, name="guest")
SERIES = "motors.left_motor.temperature"
S = 10**9


async def tried(http: httpx.AsyncClient, **body: Any) -> httpx.Response:
    """A backtest of lab_1."""
    return await http.post(PATH, json={"robot": "lab_1", "from": "-10m", **body})


async def test_what_would_have_fired(tmp_path: Path) -> None:
    now_ns = SystemClock().wall_ns()
    series = [link_pb2.Series(series_id=1, name=SERIES, topic="/lab_1/motors", field="left_motor.temperature")]
    async with running_gateway(tmp_path) as ready, AsyncExitStack() as stack:
        http, guest = [await stack.enter_async_context(client(ready, key=key)) for key in (SCOPED, VIEWER)]
        await stack.enter_async_context(ScriptedAgent(ready, "hall_1", session=b"h" * 16))
        agent = await stack.enter_async_context(ScriptedAgent(ready, "lab_1"))
        await agent.announce(series=series)
        heat = [(1, now_ns - (120 - n) * S, 97.0 if n >= 100 else 40.0 + n % 2) for n in range(120)]
        await agent.rows(1, heat)
        await agent.next("ack", DATA)
        answer = await tried(http)
        assert answer.status_code == 200, answer.text
        report = watch.Backtest.model_validate_json(answer.content)
        assert (report.robot, report.samples, report.cut) == ("lab_1", 120, False)
        fired = next(one for one in report.findings if one.detector == "motor_overheats")
        assert (fired.series, fired.severity, fired.high, fired.until) == (SERIES, "error", 95.0, None)
        assert "heat" in [one.cause for one in report.alerts]
        assert [point[1] for point in report.series[0].points][-1] == 97.0
        cool = await tried(http, checks={"motor_overheats": {"high": 120.0}}, detectors=["motor_overheats"])
        assert cool.json()["findings"] == []
        assert (await http.get("/api/v1/alert-checks")).json()["checks"], "the table is there"
        for body in (
            {"from": "soon"},
            {"from": "now", "to": "-1h"},
            {"checks": {"none": {"high": 1.0}}},
            {"checks": {"motor_overheats": {"high": "hot"}}},
            {"detectors": ["none"]},
            {"series": [""]},
            {"colour": "red"},
        ):
            refused = await tried(http, **body)
            assert (refused.status_code, refused.json()["code"]) in (
                (400, "invalid_request"),
                (404, "unknown_check"),
            ), body
        for robot in ("hall_1", "none"):
            refused = await tried(http, robot=robot)
            assert (refused.status_code, refused.json()["code"]) == (404, "unknown_robot")
        refused = await tried(guest)
        assert (refused.status_code, refused.json()["code"]) == (403, "forbidden")
