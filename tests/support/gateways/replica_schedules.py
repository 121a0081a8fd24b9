"""Rules that open an alert each at a time of their own, and how often each did: whichever replica is killed, once."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from typing import Any

from metaros.clock import SystemClock
from tests.support.gateways.replicas import Replica

__all__ = ["alerts", "fired", "schedule", "wait_for_all"]

AHEAD_S = 10.0  # a busy machine takes its time to write a rule


async def schedule(at: Replica, *, times: int, every_s: float) -> list[str]:
    """Rules that are due one after the other from now on; their names. Each is written well before it is due."""
    names = [f"tick_{number}" for number in range(times)]
    async with at.client() as http:
        for number, name in enumerate(names):
            now = datetime.fromtimestamp(SystemClock().wall_ns() / 1e9, UTC)
            due = now + timedelta(seconds=AHEAD_S + every_s * number)
            alert = {"id": "say", "kind": "alert", "severity": "warning", "robot": "r1"}
            body = {"name": name, "schedule": {"expression": f"at({due:%Y-%m-%dT%H:%M:%S})"}, "targets": [alert]}
            answer = await http.put(f"/api/v1/rules/{name}", json=body)
            assert answer.status_code == 201, answer.text
    return names


async def fired(at: Replica) -> dict[str, int]:
    """How often each rule has."""
    async with at.client() as http:
        rules: list[dict[str, Any]] = (await http.get("/api/v1/rules")).json()["rules"]
    return {rule["name"]: int(rule["stats"]["fired"]) for rule in rules}


async def alerts(at: Replica) -> list[str]:
    """The alerts there are, by what opened them."""
    async with at.client() as http:
        return [str(alert["cause"]) for alert in (await http.get("/api/v1/alerts?limit=1000")).json()["alerts"]]


async def wait_for_all(at: Replica, names: Sequence[str], *, timeout_s: float = 120.0) -> None:
    """Until each of the schedules has fired."""
    async with asyncio.timeout(timeout_s):
        while True:
            now = await fired(at)
            if all(now.get(name) for name in names):
                return
            await asyncio.sleep(0.2)
