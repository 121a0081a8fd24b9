"""`growth`: what a robot costs among 10, 100, 1,000 and 5,000 of them, and where that bends."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from load_tests.fleet.load import Load
from load_tests.fleet.run import Setting
from load_tests.fleet.steady import steady

__all__ = ["fit", "growth", "point_at_bend"]

BEND = 1.25  # a robot costs so much more than among the fewest that are measured well
LATE_MS = 500.0


async def growth(
    setting: Setting,
    rounds: list[dict[str, Any]],
    *,
    sizes: Sequence[int],
    load: Load,
    seconds: float,
    ramp_per_s: float,
) -> None:
    """A fresh gateway for each size; every robot has the same load."""
    for robots in sizes:
        figures: dict[str, Any] = {"name": f"{robots:,} robots"}
        rounds.append(figures)
        await steady(
            setting, figures, idle=0, active=robots, load=load, seconds=seconds, ramp_per_s=ramp_per_s, check=True
        )
        per_robot(figures)
        point_at_bend(rounds)


def per_robot(figures: dict[str, Any]) -> None:
    """What one of them costs."""
    robots = figures["robots"]
    figures["gateway_us_per_robot_s"] = figures["gateway_cores"] * 1e6 / robots
    for name, path in (
        ("sent_per_robot_bytes_per_s", "sent_bytes_per_s"),
        ("received_per_robot_bytes_per_s", "received_bytes_per_s"),
        ("disk_per_robot_bytes_per_s", "disk_bytes_per_s"),
        ("database_per_robot_bytes_per_s", "database_bytes_per_s"),
    ):
        figures[name] = figures[path] / robots


def fit(robots: Sequence[float], costs: Sequence[float]) -> tuple[float, float]:
    """(fixed, for each robot), both at least 0, of the sizes so far; every size weighs the same."""
    sizes, values = np.asarray(robots, float), np.asarray(costs, float)
    if len(sizes) < 2:
        return 0.0, float(values[0] / sizes[0])
    weights = 1.0 / np.maximum(values, 1e-9)
    columns = np.column_stack((np.ones_like(sizes), sizes)) * weights[:, None]
    fixed, each = np.linalg.lstsq(columns, values * weights, rcond=None)[0]
    if fixed < 0:
        return 0.0, float(np.mean(values / sizes))
    if each < 0:
        return float(np.mean(values)), 0.0
    return float(fixed), float(each)


def point_at_bend(rounds: Sequence[dict[str, Any]]) -> None:
    """Fit what came before the bend, write the fit into every round, and say at which size it no longer holds.

    It bends where the gateway is no longer the fit's (over a quarter more), or where it is late: acknowledgements over
    half a second, links that end, refusals.
    """
    known = [figures for figures in rounds if "gateway_cores" in figures]
    for figures in known:
        figures.pop("bend", None)
    straight = list(known)
    for index, figures in enumerate(known):
        if why := _late(figures):
            figures["bend"] = {"robots": figures["robots"], "text": f"{figures['robots']:,}: {why}"}
            straight = known[: max(index, 1)]
            break
    sizes = [figures["robots"] for figures in straight]
    cores = fit(sizes, [figures["gateway_cores"] for figures in straight])
    memory = fit(sizes, [figures["gateway_rss_mib"] for figures in straight])
    for figures in known:
        figures["fit_cores"] = cores[0] + cores[1] * figures["robots"]
        figures["fit_rss_mib"] = memory[0] + memory[1] * figures["robots"]
        figures["fit"] = {
            "cores_fixed": cores[0],
            "us_per_robot_s": cores[1] * 1e6,
            "mib_fixed": memory[0],
            "kib_per_robot": memory[1] * 1024,
        }


def _late(figures: dict[str, Any]) -> str:
    p99 = figures["ack_ms"]["p99"]
    if not figures.get("all_up", True):
        return "not all links came up"
    if figures.get("links_lost_while_steady"):
        return f"{figures['links_lost_while_steady']} links ended"
    if p99 > LATE_MS:
        return f"acks p99 {p99 / 1000:.1f} s at {figures['gateway_cores']:.2f} cores"
    return ""
