"""A robot and a gateway for tests of the watch: rows are waves with steps, snapshots come every other second."""

from __future__ import annotations

import asyncio
import logging
import math
import signal
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import gateway.alerting.watch.evaluation
from metaros.idl import type_hash
from tests.support.robots.load_robot import LoadRobot, RobotConfig, die_with_parent, log_to
from tests.support.robots.load_robot_gateway import GatewayConfig, run_gateway
from tests.support.robots.load_robot_stack import LoadStack

__all__ = ["SERIES", "WaveStack"]

SERIES = 8
PERIOD_S = 7.0
FLOAT = "std_msgs/msg/Float64"


class WaveRobot(LoadRobot):
    """Ten rows a second of each series in accelerated time: a row's stamp is 0.1 s after the one before it."""

    def __init__(self, config: RobotConfig) -> None:
        super().__init__(config)
        for number in range(1, SERIES):
            self.queues.channels.observe(f"/wave_{number}/metric", FLOAT, type_hash(FLOAT), qos="", keeps_all=False)
        self.all_series = sorted(held.series for held in self.outbox.ids.series.values())
        assert len(self.all_series) == SERIES
        self.start_ns = time.time_ns() // 10**9 * 10**9  # noqa: TID251 - a stamp is what a publisher says

    def give(self, kind: str, count: int) -> None:
        """Hand rows of each series to the outbox; while there is no link nothing is measured.

        So all rows come in the order of their stamps: what is back-filled would be late for any judge.
        """
        for _ in range(count if kind == "metric" and self.counters["online"] == 1 else 0):
            self.given[kind] = self.counters[kind] = row = self.given[kind] + 1
            for number, series in enumerate(self.all_series):
                step = 5.0 * (row // (500 + 90 * number) % 2)
                value = step + math.sin(row / 10 / PERIOD_S * (number + 1)) + (row * 7919 % 101) / 500
                self.outbox.append(self.streams[kind], kind, self.start_ns + row * 10**8, (series, value))


class WaveStack(LoadStack):
    """The robot above and a gateway whose watch writes snapshots all the time."""

    def _start(self, name: str, target: Callable[[Any], None], config: Any) -> None:
        super()._start(name, run_wave_robot if name == "robot" else run_watching_gateway, config)


def run_wave_robot(config: RobotConfig) -> None:
    """The robot's process."""
    die_with_parent()
    log_to(config.folder / "robot.log")
    logging.basicConfig(level=logging.INFO, force=True)
    asyncio.run(_run(config))


async def _run(config: RobotConfig) -> None:
    stop = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, stop.set)
    await WaveRobot(replace(config, bulk=0)).run(stop)


def run_watching_gateway(config: GatewayConfig) -> None:
    """The gateway's process."""
    vars(gateway.alerting.watch.evaluation)["SNAPSHOT_S"] = vars(gateway.alerting.watch.evaluation)["RETRY_S"] = 2.0
    run_gateway(config)
