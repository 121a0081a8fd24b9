"""`bulk`: some robots send more than they may, and what piled up; do the others notice?"""

from __future__ import annotations

import asyncio
from typing import Any

from load_tests.fleet.conclude import conclude, fresh, gateway_figures, goal
from load_tests.fleet.figures import Histogram
from load_tests.fleet.load import Load
from load_tests.fleet.run import Run, Setting, running
from load_tests.fleet.steady import kept

__all__ = ["bulk"]

UP_S = 60.0
MOST_RATIO, TOLERATED_MS = 3.0, 250.0


async def bulk(
    setting: Setting,
    figures: dict[str, Any],
    *,
    honest: int,
    heavy: int,
    load: Load,
    heavy_load: Load,
    quota_bytes_per_s: int,
    seconds: float,
    outage_s: float,
) -> None:
    """Honest robots alone; beside heavy ones over their quota; and when those come back with what piled up."""
    figures |= {"honest": honest, "heavy": heavy, "load": load.describe(), "heavy_load": heavy_load.describe()}
    figures["quota_bytes_per_s"] = quota_bytes_per_s
    options = (*setting.gateway_options, "--robot-bytes-per-s", str(quota_bytes_per_s))
    chosen = Setting(**{**{name: getattr(setting, name) for name in setting.__slots__}, "gateway_options": options})
    async with running(chosen, figures) as run:
        await run.simulator.join([load] * honest, per_s=100.0)
        await run.simulator.all_up(timeout_s=UP_S)
        await asyncio.sleep(2.0)
        acks = _listen(run)
        await _phase(run, figures, acks, "alone", seconds)
        run.mark("heavy ones")
        await run.simulator.join([heavy_load] * heavy, per_s=50.0, prefix="heavy")
        await run.simulator.all_up(timeout_s=UP_S)
        await asyncio.sleep(2.0)
        await _phase(run, figures, acks, "beside_heavy", seconds)
        run.mark("heavy ones away")
        for robot in run.simulator.robots[honest:]:
            robot.cut(for_s=outage_s)
        await asyncio.sleep(outage_s)
        run.mark("back with what piled up")
        await _phase(run, figures, acks, "beside_backfill", seconds)
        await conclude(run, figures)
    alone = figures["alone"]["ack_ms"]["p99"]
    figures["goals"] = [
        goal(
            figures[name]["ack_ms"]["p99"] <= max(MOST_RATIO * alone, TOLERATED_MS),
            f"honest robots' p99 of acks {figures[name]['ack_ms']['p99']:.0f} ms {name.replace('_', ' ')}, "
            f"{alone:.0f} ms alone; goal: three times, or {TOLERATED_MS:.0f} ms",
        )
        for name in ("beside_heavy", "beside_backfill")
    ] + kept(figures)


def _listen(run: Run) -> dict[bool, Histogram]:
    """Latencies of acknowledgements, of the heavy robots and of the others."""
    found = {True: Histogram(), False: Histogram()}
    run.simulator.on_stored = lambda robot, seconds: found[robot.name.startswith("heavy")].add(seconds)
    return found


async def _phase(run: Run, figures: dict[str, Any], acks: dict[bool, Histogram], name: str, seconds: float) -> None:
    fresh(run)
    acks[True], acks[False] = Histogram(), Histogram()
    from_s, stored = run.now_s, run.simulator.counts.stored
    await asyncio.sleep(seconds)
    figures[name] = {
        **gateway_figures(run, from_s, run.now_s),
        "ack_ms": acks[False].summary_ms(),
        "heavy_ack_ms": acks[True].summary_ms(),
        "frames_stored_per_s": (run.simulator.counts.stored - stored) / (run.now_s - from_s),
    }
