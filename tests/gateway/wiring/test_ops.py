"""What operators see of a whole gateway, however large its fleet is."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from gateway.domain.robot import Robot
from gateway.ingest.registry import RobotRecord
from gateway.settings import Settings
from gateway.wiring.gateway import Gateway
from metaros._proto import link_pb2
from metaros.clock import ManualClock
from metaros.errors import ConfigError

FLEET = 2000


def record(number: int) -> RobotRecord:
    """A robot that is online; its clock is a second behind the gateway's."""
    made = RobotRecord(Robot(f"r{number}", "/", "host", "1", {}), seen_ns=1)
    made.here, made.lag_ns = True, number * 10**6 + 10**9
    link = link_pb2.LinkStatistics(clock_offset_ns=10**9, classes=[link_pb2.ClassDepth(name="live", lost=1)])
    made.statistics = link_pb2.TopicStatistics(outbox_bytes=number, link=link)
    return made


async def test_a_scrape_lets_others_have_their_turn_and_does_not_grow_with_the_fleet(tmp_path: Path) -> None:
    gateway = Gateway(Settings(data_dir=tmp_path), clock=ManualClock())
    try:
        for number in range(FLEET):
            gateway.registry.add(record(number))
        scrape, turns = asyncio.create_task(gateway.operations.families()), 0
        while not scrape.done():
            await asyncio.sleep(0)
            turns += 1
        samples = [sample for family in scrape.result().collect() for sample in family.samples]
    finally:
        await gateway.stop()
    assert turns >= FLEET // 64, "whoever waited got the loop between any 64 robots"
    assert len(samples) < 100
    lags = {sample.labels["robot"]: sample.value for sample in samples if sample.name == "metaros_robot_lag_seconds"}
    assert lags == {f"r{number}": pytest.approx(number / 1000) for number in range(FLEET - 20, FLEET)}


async def test_what_ends_is_not_ready(tmp_path: Path) -> None:
    gateway = Gateway(Settings(data_dir=tmp_path), clock=ManualClock())
    try:
        assert gateway.checks() == {"store": "ok"}
        gateway.operations.draining = True
        assert gateway.checks() == {"store": "ok", "end": "draining"}
        assert (await gateway.operations.report())["draining"] is True
    finally:
        await gateway.stop()


@pytest.mark.parametrize("wrong", [{"log_format": "xml"}, {"log_level": "loud"}, {"otlp": "collector"}])
def test_settings_that_cannot_work_are_refused(wrong: dict[str, str]) -> None:
    with pytest.raises(ConfigError, match=r"--log|--otlp"):
        Settings(**wrong)  # type: ignore[arg-type]
