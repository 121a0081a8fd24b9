"""A real gateway in this process whose anomaly evaluator the test replaces: findings open and clear on command."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest

from gateway import main
from gateway.api.services import Services
from gateway.app import services_of
from gateway.domain.alert import Alert
from gateway.domain.finding import Edge, Finding
from gateway.main import Ready
from gateway.wiring.gateway import Gateway
from metaros.clock import SystemClock
from tests.gateway.harness import running_gateway

__all__ = ["Alerting", "alerting_gateway", "finding", "settled"]


def finding(robot: str, **more: Any) -> Finding:
    """A motor that is too hot, now."""
    facts: dict[str, Any] = {
        "series": "motors.left_motor.temperature",
        "kind": "motor_overheats",
        "cause": "heat",
        "severity": "error",
        "score": 0.9,
        "value": 97.5,
        "low": float("nan"),
        "high": 95.0,
        "reason": "97.5 °C is above 95 °C",
        "since_s": SystemClock().wall_ns() / 1e9,
    }
    return Finding(robot=robot, **{**facts, **more})


class Alerting:
    """The gateway's address and its inside."""

    def __init__(self, ready: Ready, services: Services) -> None:
        self.ready, self.services = ready, services

    def clear(self, found: Finding) -> None:
        """The finding is over."""
        self.services.alerts.report([Edge("cleared", found, found.since_s + 1)])

    async def open(self, robot: str, **more: Any) -> Alert:
        """A finding of the robot; its alert, once that is stored."""
        found = finding(robot, **more)
        self.services.alerts.report([Edge("opened", found, found.since_s)])

        def stored() -> Alert | None:
            mine = [one for one in self.services.alerts.of(robot) if one.cause == found.cause]
            return mine[0] if mine and mine[0].revision else None

        opened = await settled(stored)
        assert opened is not None
        return opened


async def settled(state: Callable[[], Any]) -> Any:
    """What `state` gives once it gives anything, within 60 s."""
    async with asyncio.timeout(60):
        while True:
            if found := state():
                return found
            await asyncio.sleep(0.02)


@asynccontextmanager
async def alerting_gateway(folder: Path, **settings: Any) -> AsyncIterator[Alerting]:
    """The gateway, running."""
    made: list[Gateway] = []

    class Kept(Gateway):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            made.append(self)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "Gateway", Kept)
        async with running_gateway(folder, **settings) as ready:
            yield Alerting(ready, services_of(made[0]))
