"""How long until a robot is back: kill the gateway or the agent with SIGKILL, over and over, and time the recovery.

Each cycle kills one of the real programs at a random moment, starts it again as a supervisor would, and waits until the
robot is online again, in a new session; the time is from the kill. Prints one line a cycle and a summary; the pass mark
is the 95th percentile.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

from metaros.clock import system_rng
from tests.support.processes.stack import Stack
from tests.support.waiting import wait_until

__all__ = ["main"]


def online_since(stack: Stack) -> str | None:
    """When the robot's present session began, as the gateway says; None while it is offline."""
    answer = stack.get("/api/v1/robots") or {"robots": []}
    return next((robot["since"] for robot in answer["robots"] if robot["state"] == "online"), None)


def recover(stack: Stack, victim: str) -> float:
    """Kill `victim`, start it again, and time how long from the kill until the robot is online in a new session."""
    program = next(running for running in stack.programs if running.name == victim)
    before = online_since(stack)
    began = time.monotonic()
    program.kill()
    stack.restart(program)
    wait_until(lambda: online_since(stack) not in (None, before), timeout_s=30)
    return time.monotonic() - began


def main(argv: list[str] | None = None) -> int:
    """Run the campaign; exit code 1 when a recovery took longer than the limit."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cycles", type=int, default=200)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--limit-s", type=float, default=2.0, help="pass mark of the 95th percentile")
    options = parser.parse_args(argv)
    rng = system_rng()
    seed = options.seed if options.seed is not None else rng.randrange(2**32)
    rng.seed(seed)
    print(f"recovery: {options.cycles} kills, seed {seed}", flush=True)
    times: dict[str, list[float]] = {"gateway": [], "agent-sim_1": []}
    with tempfile.TemporaryDirectory() as folder, Stack(Path(folder)) as stack:
        stack.router()
        stack.gateway()
        stack.sim()
        stack.agent("sim_1")
        wait_until(lambda: stack.online() == {"sim_1"}, timeout_s=30)
        for cycle in range(1, options.cycles + 1):
            time.sleep(rng.uniform(0.0, 0.5))
            victim = rng.choice(sorted(times))
            times[victim].append(recover(stack, victim))
            print(f"{cycle:5} {victim:12} back after {times[victim][-1] * 1000:5.0f} ms", flush=True)
    worst = 0.0
    for victim, seconds in times.items():
        if len(seconds) >= 2:
            p95 = statistics.quantiles(seconds, n=20, method="inclusive")[-1]
            worst = max(worst, p95)
            middle = statistics.median(seconds)
            print(f"{victim}: n={len(seconds)} median {middle:.2f} s, p95 {p95:.2f} s, max {max(seconds):.2f} s")
    return int(worst > options.limit_s)


if __name__ == "__main__":
    raise SystemExit(main())
