"""`chaos`: gateway killed, links cut, while load goes on; at the end everything is there once."""

from __future__ import annotations

import asyncio
import signal
from collections import Counter
from typing import Any, Final

from load_tests.fleet.conclude import conclude, fresh, gateway_figures, goal, interleave
from load_tests.fleet.load import Load
from load_tests.fleet.run import Run, Setting, running
from load_tests.fleet.steady import kept

__all__ = ["ACTS", "chaos"]

UP_S = 60.0
BACK_S = 60.0
# what happens, and how often among the rest
ACTS: Final = (
    ("kill the gateway", 3),
    ("restart the gateway", 1),
    ("stall the gateway", 2),
    ("cut all", 1),
    ("cut some", 4),
)


async def chaos(
    setting: Setting, figures: dict[str, Any], *, idle: int, active: int, load: Load, acts: int, pause_s: float
) -> None:
    """So many acts with a pause between them; links have to be back after each."""
    robots = idle + active
    figures |= {"robots": robots, "load": load.describe(), "acts": acts, "seed": setting.seed}
    async with running(setting, figures) as run:
        await run.simulator.join(interleave(idle, active, load), per_s=100.0)
        await run.simulator.all_up(timeout_s=UP_S)
        fresh(run)
        from_s, done, back_s = run.now_s, Counter[str](), []
        names, weights = [name for name, _ in ACTS], [weight for _, weight in ACTS]
        for _ in range(acts):
            act = run.simulator.rng.choices(names, weights)[0]
            done[act] += 1
            run.mark(act)
            began_s = run.now_s
            await _act(run, act)
            if await run.simulator.all_up(timeout_s=BACK_S):
                back_s.append(run.now_s - began_s)
            else:
                run.faults.append(f"after {act} {robots - run.simulator.counts.up} links stayed away")
            figures |= {"done": dict(done), "back_s": [round(value, 2) for value in back_s]}
            await asyncio.sleep(pause_s * (0.5 + run.simulator.rng.random()))
        figures |= gateway_figures(run, from_s, run.now_s)
        await conclude(run, figures)
    figures["goals"] = [
        goal(
            len(back_s) == acts, f"links were all back after {len(back_s)} of {acts} acts, at most {max(back_s):.1f} s"
        ),
        *kept(figures),
    ]


async def _act(run: Run, act: str) -> None:
    rng = run.simulator.rng
    if act == "kill the gateway":
        await asyncio.to_thread(run.gateway.kill, signal.SIGKILL)
        await asyncio.sleep(rng.random())
        await asyncio.to_thread(run.start_gateway)
    elif act == "restart the gateway":
        await asyncio.to_thread(run.gateway.stop)
        await asyncio.to_thread(run.start_gateway)
    elif act == "stall the gateway":
        run.gateway.kill(signal.SIGSTOP)
        await asyncio.sleep(0.5 + 2.5 * rng.random())
        run.gateway.kill(signal.SIGCONT)
    else:
        robots = run.simulator.robots
        some = robots if act == "cut all" else rng.sample(robots, len(robots) // 5)
        for robot in some:
            robot.cut(for_s=rng.random() * 2)
