"""Random SIGKILL and SIGSTOP of robot, gateway or both under load, and what the store has afterwards.

Cycles run in legs, each with its own folder, processes and seed; after a leg everything is drained, ended well and
compared: the store's rows and gaps, the robot's journal of what it accepted, and the outbox's own last numbers. A leg
that fails keeps its folder and prints the command that repeats it.

    python -m load_tests.campaigns kills [--cycles 1000] [--leg 100] [--tick-ms 5] [--seed N] [--keep]
"""

from __future__ import annotations

import argparse
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from random import Random

from metaros.clock import system_rng
from tests.support.robots.checker import Verdict
from tests.support.robots.load_robot_stack import LoadStack

__all__ = ["ACTS", "main", "run_legs"]

ACTS = (
    ("kill robot", 5),
    ("kill gateway", 5),
    ("kill both", 3),
    ("stop robot", 2),
    ("stop gateway", 2),
    ("stop both", 1),
)
Break = Callable[[LoadStack, Random, str], None]


def victims(act: str) -> list[str]:
    """Whom an act is against."""
    who = act.partition(" ")[2]
    return ["robot", "gateway"] if who == "both" else [who]


def break_one(stack: LoadStack, rng: Random, act: str) -> None:
    """Kill or stop, and make it run again."""
    names = rng.sample(victims(act), len(victims(act)))
    if act.startswith("stop"):
        for name in names:
            stack.signal(name, signal.SIGSTOP)
        time.sleep(rng.uniform(0.01, 0.4))
        if rng.random() < 0.7:
            for name in names:
                stack.signal(name, signal.SIGCONT)
            return
    for name in names:
        stack.kill(name)
    time.sleep(rng.choice((0.0, 0.0, rng.uniform(0.0, 0.3))))
    for name in names:
        stack.start(name)


def live(stack: LoadStack, rng: Random) -> None:
    """Let it run: often until the link is up and samples flow, sometimes not even until it has started."""
    stack.supervise()
    if rng.random() < 0.75:
        began = time.monotonic()
        while stack.counters["online"] != 1 and time.monotonic() - began < 20:
            stack.supervise()
            time.sleep(0.005)
        time.sleep(rng.uniform(0.0, 0.3))
    else:
        time.sleep(rng.uniform(0.0, 0.15))


def run_leg(
    stack: LoadStack, rng: Random, cycles: int, acts: tuple[tuple[str, int], ...], act_on: Break
) -> Counter[str]:
    """The cycles of one leg; how often each act was. Each comes once before one comes again by its weight."""
    done: Counter[str] = Counter()
    stack.start("gateway")
    stack.start("robot")
    stack.wait_online()
    names, weights = zip(*acts, strict=True)
    first = rng.sample(names, len(names))
    for cycle in range(1, cycles + 1):
        live(stack, rng)
        act = first.pop() if first else rng.choices(names, weights)[0]
        act_on(stack, rng, act)
        done[act] += 1
        if sys.stdout.isatty():
            print(f"\r  cycle {cycle} of {cycles}: {act:24}", end="", flush=True)
    if sys.stdout.isatty():
        print("\r" + 60 * " " + "\r", end="")
    return done


def run_legs(
    options: argparse.Namespace,
    make: Callable[[Path], LoadStack],
    *,
    name: str = "kills",
    acts: tuple[tuple[str, int], ...] = ACTS,
    act_on: Break = break_one,
) -> int:
    """All legs with a line each, a table, and the exit code."""
    seed = options.seed if options.seed is not None else system_rng().randrange(2**32)
    print(f"{name}: {options.cycles} cycles in legs of {options.leg}, seed {seed}", flush=True)
    print(HEAD, flush=True)
    total, done, began = Verdict(), Counter[str](), time.monotonic()
    for leg, start in enumerate(range(0, options.cycles, options.leg)):
        cycles = min(options.leg, options.cycles - start)
        folder = Path(tempfile.mkdtemp(prefix=f"campaign-{name}-"))
        leg_began, verdict, keep = time.monotonic(), Verdict(), True
        try:
            with make(folder) as stack:
                done += run_leg(stack, Random(seed + leg), cycles, acts, act_on)
                verdict = stack.check()
            keep = options.keep or not verdict.good
        except (AssertionError, TimeoutError) as error:  # it says so, and the other legs go on
            verdict.blame("lost", 1, f"the leg did not end: {error}")
        print(row(f"{start + cycles}", verdict, time.monotonic() - leg_began), flush=True)
        for problem in verdict.problems[:10]:
            print(f"    {problem}")
        if keep:
            print(f"    folder {folder}; repeat: make campaign ARGS='{name} --cycles {cycles} --seed {seed + leg}'")
        else:
            shutil.rmtree(folder)
        total.add(verdict)
    summary(total, done, time.monotonic() - began)
    return int(not total.good)


HEAD = (
    f"{'cycles':>7} {'accepted':>10} {'rows':>10} {'declared':>9} {'lost':>5} {'dup':>5} {'wrong':>6} {'unsynced':>9} "
    f"{'s':>6}"
)


def row(what: str, verdict: Verdict, seconds: float) -> str:
    """A line of the table."""
    numbers = (verdict.lost, verdict.duplicate, verdict.wrong, verdict.unaccepted)
    return (
        f"{what:>7} {verdict.accepted:>10,} {verdict.rows:>10,} {verdict.declared:>9,} "
        f"{numbers[0]:>5} {numbers[1]:>5} {numbers[2]:>6} {numbers[3]:>9,} {seconds:>6.0f}"
    )


def summary(total: Verdict, done: Counter[str], seconds: float) -> None:
    """What it comes to."""
    print(row("all", total, seconds))
    print("  " + ", ".join(f"{act} {count}" for act, count in sorted(done.items())))
    kills = sum(count for act, count in done.items() if act in ("kill robot", "kill both", "stop robot", "stop both"))
    if kills:
        print(f"  unsynced: handed over and gone with the robot before its sync, {total.unaccepted / kills:.0f} a blow")
    print(f"  {'PASS' if total.good else 'FAIL'}: {total.lost} lost, {total.duplicate} duplicate, {total.wrong} wrong")


def parser(description: str | None, *, cycles: int) -> argparse.ArgumentParser:
    """The options that kill campaigns share."""
    made = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    made.add_argument("--cycles", type=int, default=cycles)
    made.add_argument("--leg", type=int, default=100, help="cycles between two checks")
    made.add_argument("--tick-ms", type=float, default=5.0, help="how often the robot makes some samples")
    made.add_argument("--seed", type=int, default=None)
    made.add_argument("--keep", action="store_true", help="keep every leg's folder")
    return made


def main(argv: list[str] | None = None) -> int:
    """Run the campaign; exit code 1 when a sample was lost, stored twice, or wrong."""
    options = parser(__doc__, cycles=1000).parse_args(argv)
    return run_legs(options, lambda folder: LoadStack(folder, robot={"tick_s": options.tick_ms / 1e3}))


if __name__ == "__main__":
    raise SystemExit(main())
