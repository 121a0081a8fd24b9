"""What the gateway tells the watch and the alert manager of robots that came, went, or are not expected any more."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from gateway.domain.finding import Edge
from gateway.domain.robot import Robot
from gateway.ingest.registry import Registry, RobotRecord
from gateway.settings import Settings
from gateway.store import Store
from gateway.store.retention import Retention
from gateway.wiring.alerting import Alerting
from metaros.clock import ManualClock
from tests.support.gateways.alerting_gateway import finding

ROBOT = "arm"


@asynccontextmanager
async def alerting(folder: Path, clock: ManualClock, *, enrolled_ns: int | None) -> AsyncIterator[Alerting]:
    """The wiring over a real store, with a robot that is offline."""
    registry = Registry()
    registry.add(RobotRecord(Robot(id=ROBOT, namespace="/arm", hostname="h", agent_version="1"), seen_ns=1))
    store = Store(folder, clock=clock, retention=Retention(age_s=1e9, size_bytes=1 << 40), queue_bytes=1 << 20)
    around: Any = SimpleNamespace(
        store=store,
        registry=registry,
        recordings=None,
        events=SimpleNamespace(journal=SimpleNamespace(emit=lambda *reported: None)),
        presence=SimpleNamespace(of=lambda robot: (False, 0)),
        twins=SimpleNamespace(cache=SimpleNamespace(watch=lambda listener: None), labels_of=lambda robot: {}),
        identities=SimpleNamespace(robots=SimpleNamespace(enrolled_ns=lambda robot: enrolled_ns)),
        ros=SimpleNamespace(),
    )
    store.start()
    try:
        made = Alerting(Settings(data_dir=folder), around, clock=clock)
        await made.start()
        await made.watch.begin()
        yield made
        await made.close()
    finally:
        await store.close()


async def alerts_after_two_minutes(folder: Path, *, enrolled_ns: int | None) -> list[str]:
    """What is open of a robot that had an alert when it was looked at, once every grace is over."""
    clock = ManualClock(wall_ns=1_700_000_000 * 10**9)
    async with alerting(folder, clock, enrolled_ns=enrolled_ns) as made:
        made.manager.report([Edge("opened", finding(ROBOT, since_s=clock.wall_ns() / 1e9), clock.wall_ns() / 1e9)])
        await made.look()
        for _ in range(5):
            clock.advance(60.0)
            await made.look()
            made.manager.tick()
        return [alert.cause for alert in made.manager.of(ROBOT)]


async def test_alerts_of_a_robot_that_was_revoked_end(tmp_path: Path) -> None:
    assert await alerts_after_two_minutes(tmp_path, enrolled_ns=None) == []


async def test_alerts_of_a_robot_that_is_only_away_stay(tmp_path: Path) -> None:
    assert await alerts_after_two_minutes(tmp_path, enrolled_ns=0) == ["heat"]
