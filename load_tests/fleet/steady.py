"""`steady`: many idle and some active robots for a while, and then: is everything stored once?"""

from __future__ import annotations

import asyncio
from typing import Any

from load_tests.fleet.conclude import conclude, fresh, gateway_figures, goal, interleave
from load_tests.fleet.load import Load
from load_tests.fleet.run import Setting, running

__all__ = ["steady"]

UP_S = 180.0


async def steady(
    setting: Setting,
    figures: dict[str, Any],
    *,
    idle: int,
    active: int,
    load: Load,
    seconds: float,
    ramp_per_s: float,
    check: bool = True,
) -> None:
    """Robots come, stay for `seconds`, hand over nothing more, and are compared with the store."""
    robots = idle + active
    figures |= {"robots": robots, "idle": idle, "active": active, "load": load.describe()}
    async with running(setting, figures) as run:
        await asyncio.sleep(2.0)
        bare, bare_pss = run.look(), await asyncio.to_thread(run.pss)
        run.mark("robots come")
        await run.simulator.join(interleave(idle, active, load), per_s=ramp_per_s)
        figures["all_up"] = await run.simulator.all_up(timeout_s=UP_S)
        await asyncio.sleep(min(5.0, seconds / 2))
        fresh(run)
        from_s, downs, held = run.now_s, run.simulator.counts.downs.total(), run.storage()
        run.mark("steady")
        await asyncio.sleep(seconds)
        to_s = run.now_s
        figures |= gateway_figures(run, from_s, to_s)
        figures["links_lost_while_steady"] = run.simulator.counts.downs.total() - downs
        now, storage = run.look(), run.storage()
        if bare is not None and now is not None:
            figures["rss_before_robots_mib"] = bare.rss_bytes / 2**20
            figures["rss_per_robot_kib"] = (now.rss_bytes - bare.rss_bytes) / robots / 1024
            figures["rss_per_connection_kib"] = figures["rss_per_robot_kib"] / 3
        figures["pss_per_robot_kib"] = (await asyncio.to_thread(run.pss) - bare_pss) / robots / 1024
        figures["storage_bytes"] = storage
        figures["disk_bytes_per_s"] = (storage["all"] - held["all"]) / (to_s - from_s)
        figures["database_bytes_per_s"] = (storage["database"] - held["database"]) / (to_s - from_s)
        run.mark("no more load")
        if check:
            await conclude(run, figures)
    figures["goals"] = [
        goal(figures["all_up"], f"all {robots:,} links came up"),
        goal(
            not figures["links_lost_while_steady"], f"no link ended while steady: {figures['links_lost_while_steady']}"
        ),
        goal(
            not run.simulator.counts.goodbyes and not run.simulator.counts.put_off,
            f"no refusal: {run.simulator.counts.goodbyes.total()} goodbyes, "
            f"{run.simulator.counts.put_off.total()} put off",
        ),
        *kept(figures),
    ]


def kept(figures: dict[str, Any]) -> list[dict[str, Any]]:
    """The promise of delivery as a goal, where it was looked at."""
    if "lost" not in figures:
        return []
    text = f"{figures['lost']} lost, {figures['duplicated']} duplicated of {figures['accepted']:,}"
    whole = not figures["lost"] and not figures["duplicated"] and not figures["not_acknowledged"]
    return [goal(whole, f"{text}; {figures['not_acknowledged']} not acknowledged at the end")]
