"""`storm`: under a thousand robots the gateway is killed, or every link is cut; how long until all are back?"""

from __future__ import annotations

import asyncio
import signal
from collections.abc import Sequence
from typing import Any

from load_tests.fleet.conclude import conclude, fresh, gateway_figures, goal, interleave
from load_tests.fleet.load import Load
from load_tests.fleet.run import Run, Setting, running
from load_tests.fleet.steady import kept

__all__ = ["longest", "storm"]

UP_S = 180.0
BACK_S, PINNED_S = 30.0, 10.0
PINNED_CORES = 0.95


async def storm(
    setting: Setting,
    figures: dict[str, Any],
    *,
    how: str,
    idle: int,
    active: int,
    load: Load,
    seconds: float,
    ramp_per_s: float,
) -> None:
    """`how`: kill (SIGKILL and a new process), restart (SIGTERM and a new one), cut (every connection at once)."""
    robots = idle + active
    figures |= {"robots": robots, "idle": idle, "active": active, "load": load.describe(), "how": how}
    async with running(setting, figures) as run:
        await run.simulator.join(interleave(idle, active, load), per_s=ramp_per_s)
        figures["all_up"] = await run.simulator.all_up(timeout_s=UP_S)
        await asyncio.sleep(seconds)
        fresh(run)
        run.mark(how)
        began_s, ups = run.now_s, run.simulator.counts.ups
        serving_s = await _break(run, how)
        figures["gateway_serves_after_s"] = serving_s - began_s
        back = await run.simulator.until(
            lambda: run.simulator.counts.up == robots and run.simulator.counts.ups >= ups + robots, timeout_s=120.0
        )
        figures["all_back"] = back
        figures["all_back_s"] = run.now_s - began_s
        figures["all_back_after_serving_s"] = run.now_s - serving_s
        run.mark("all back")
        figures["links_of_the_storm"] = run.simulator.counts.ups - ups
        figures["link_up_after_storm_ms"] = run.simulator.counts.up_s.summary_ms()
        await asyncio.sleep(seconds)
        figures |= gateway_figures(run, began_s, run.now_s)
        figures["pinned_s"] = longest(run.between("gateway_cores", serving_s, run.now_s), PINNED_CORES)
        await conclude(run, figures)
    figures["goals"] = [
        goal(
            back and figures["all_back_s"] <= BACK_S,
            f"all {robots:,} back after {figures['all_back_s']:.1f} s; goal 30 s (the gateway served after "
            f"{figures['gateway_serves_after_s']:.1f} s)",
        ),
        goal(
            figures["pinned_s"] <= PINNED_S,
            f"gateway at {PINNED_CORES} cores or more for {figures['pinned_s']} s; goal 10 s",
        ),
        *kept(figures),
    ]


async def _break(run: Run, how: str) -> float:
    """Do it; when the gateway serves again, in seconds of the run."""
    if how == "cut":
        for robot in run.simulator.robots:
            robot.cut()
        return run.now_s
    if how == "kill":
        await asyncio.to_thread(run.gateway.kill, signal.SIGKILL)
    else:
        await asyncio.to_thread(run.gateway.stop)
    await asyncio.to_thread(run.start_gateway)
    run.mark("serves again")
    return run.now_s


def longest(values: Sequence[float], least: float) -> int:
    """The longest stretch of looks, a second each, at `least` or more."""
    most = now = 0
    for value in values:
        now = now + 1 if value >= least else 0
        most = max(most, now)
    return most
