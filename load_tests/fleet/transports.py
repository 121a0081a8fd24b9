"""`transports`: what a robot costs the simulator itself over its own HTTP/2, over grpc.aio and over WebSockets."""

from __future__ import annotations

import os
from dataclasses import replace
from typing import Any

import psutil

from load_tests.fleet.load import Load
from load_tests.fleet.run import Setting
from load_tests.fleet.steady import steady

__all__ = ["transports"]


async def transports(
    setting: Setting, rounds: list[dict[str, Any]], *, idle: int, active: int, load: Load, seconds: float
) -> None:
    """The same fleet by each; a fresh gateway each time. Memory is this process's, so the lightest goes first."""
    for name in ("grpc", "ws", "aio"):
        figures: dict[str, Any] = {"name": {"grpc": "HTTP/2", "ws": "WebSocket", "aio": "grpc.aio"}[name]}
        rounds.append(figures)
        process = psutil.Process(os.getpid())
        before = process.memory_info().rss
        chosen = replace(setting, transport=name)
        await steady(
            chosen, figures, idle=idle, active=active, load=load, seconds=seconds, ramp_per_s=50.0, check=False
        )
        robots = idle + active
        figures["simulator_kib_per_robot"] = (process.memory_info().rss - before) / robots / 1024
        figures["simulator_us_per_robot_s"] = figures.get("simulator_cores", 0.0) * 1e6 / robots
