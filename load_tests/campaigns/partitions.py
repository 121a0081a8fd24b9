"""A network between robot and gateway that cuts, loses, flaps, crawls and swallows; nothing may be lost.

Each kind of fault has its own two network namespaces, robot and gateway; with `--together` the kinds take turns in one
pair, so that everything starts once. After each fault the network is healed and the time is taken until the gateway
acknowledges again. What can go wrong in several ways, as one direction or the other, does so in turn. At the end
everything is drained and compared, as in `kills`.
Needs Linux with user namespaces, nftables and iproute2; runs as any user.

    python -m load_tests.campaigns partitions [--kinds cut,loss] [--cycles 50] [--together] [--seed N]
"""

from __future__ import annotations

import argparse
import itertools
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

from load_tests.campaigns.namespaces import result, run_parts
from metaros.clock import system_rng
from tests.support.processes.netns import HERE, Wire, why_not
from tests.support.robots.load_robot_stack import LoadStack

__all__ = ["KINDS", "main"]

HEARTBEAT_S = 0.5
RESUME_S = 2.0  # the goal
LIMIT_S = 10.0  # what fails, whatever else the machine does


def cut(wire: Wire, stack: LoadStack, rng: Random, turn: int) -> None:
    """The cable is out for a while."""
    wire.pull()
    time.sleep(rng.choice((0.1, 0.5, 1.0, 2.5)))
    wire.plug()


def one_way(wire: Wire, stack: LoadStack, rng: Random, turn: int) -> None:
    """One direction is gone."""
    up = turn % 2 == 0
    wire.drop(towards_here=up, towards_there=not up)
    time.sleep(rng.choice((0.1, 0.5, 1.0, 2.0)))


def loss(wire: Wire, stack: LoadStack, rng: Random, turn: int) -> None:
    """Every tenth packet is gone."""
    wire.drop(percent=10)
    time.sleep(rng.uniform(0.5, 1.5))


def flap(wire: Wire, stack: LoadStack, rng: Random, turn: int) -> None:
    """50 ms there, 50 ms gone."""
    wire.flap(rng.randrange(4, 16))


def crawl(wire: Wire, stack: LoadStack, rng: Random, turn: int) -> None:
    """1 Mbit/s, less than the robot makes."""
    wire.slow()
    time.sleep(rng.uniform(0.5, 1.5))


def half_open(wire: Wire, stack: LoadStack, rng: Random, turn: int) -> None:
    """Packets vanish, and one side dies meanwhile: the other still holds its connection."""
    wire.drop()
    who = ("robot", "gateway", "")[turn % 3]
    if who:
        stack.kill(who)
    time.sleep(rng.choice((0.1, 0.5, 1.7)))
    wire.heal()
    if who:
        stack.start(who)


KINDS: dict[str, Callable[[Wire, LoadStack, Random, int], None]] = {
    "cut": cut,
    "one-way": one_way,
    "loss": loss,
    "flap": flap,
    "crawl": crawl,
    "half-open": half_open,
}


def run_inside(kinds: list[str], cycles: int, seed: int, *, explain_s: float) -> int:
    """Kinds that take turns, in the namespaces of this process; the last line printed is the result."""
    rng, times = Random(seed), list[float]()
    with tempfile.TemporaryDirectory(prefix="campaign-partitions-") as folder, Wire() as wire:
        robot = {"network_of": wire.pid, "tick_s": 0.01, "bulk": 10}
        gateway = {"host": HERE, "heartbeat_s": HEARTBEAT_S}
        with LoadStack(Path(folder), robot=robot, gateway=gateway) as stack:
            stack.start("gateway")
            stack.start("robot")
            stack.wait_online()
            for turn, kind in itertools.product(range(cycles), kinds):
                time.sleep(rng.uniform(0.05, 0.2))
                KINDS[kind](wire, stack, rng, turn)
                healed_ns = time.monotonic_ns()
                wire.heal()
                try:
                    times.append(stack.wait_ack(healed_ns, timeout_s=30.0))
                except AssertionError:
                    logs = f"{stack.tail('robot')}{stack.tail('gateway')}"
                    print(f"no acknowledgement after fault {len(times) + 1}, {kind}\n{logs}")
                    raise
                if times[-1] > explain_s:
                    print(f"fault {len(times)}, {kind}: back after {times[-1]:.2f} s\n{stack.tail('robot')[-1200:]}")
            sessions = stack.counters["sessions"]
            verdict = stack.check()
    return result(verdict, times=times, sessions=sessions)


def show(part: str, facts: dict[str, Any]) -> bool:
    """A line of the table; whether every link came back."""
    kind = part if part in KINDS else "together"
    times = facts["times"]
    p95 = statistics.quantiles(times, n=20, method="inclusive")[-1] if len(times) > 1 else times[0]
    print(
        f"{kind:>10} {len(times):>7} {facts['accepted']:>9,} {facts['rows']:>9,} {facts['declared']:>9,} "
        f"{facts['lost']:>5} {facts['duplicate']:>5} {facts['wrong']:>6} {facts['sessions']:>9}"
        f" {statistics.median(times):>7.2f} {p95:>6.2f} {max(times):>6.2f}"
    )
    return bool(max(times) <= LIMIT_S)


HEAD = (
    f"{'kind':>10} {'cycles':>7} {'accepted':>9} {'rows':>9} {'declared':>9} {'lost':>5} {'dup':>5} {'wrong':>6} "
    f"{'sessions':>9} {'median':>7} {'p95':>6} {'max s':>6}"
)


def main(argv: list[str] | None = None) -> int:
    """Run the campaign; exit code 1 when a sample was lost, stored twice, or wrong, or a link stayed down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--cycles", type=int, default=50)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--explain", type=float, default=RESUME_S, help="show the robot's log where it took longer, s")
    parser.add_argument("--parallel", type=int, default=3, help="kinds at a time")
    parser.add_argument("--together", action="store_true", help="all kinds in turn, on one robot and gateway")
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    seed = options.seed if options.seed is not None else system_rng().randrange(2**32)
    if options.inside:
        return run_inside(options.inside.split(","), options.cycles, seed, explain_s=options.explain)
    if reason := why_not():
        print(f"partitions cannot run here: {reason}")
        return 0
    print(f"partitions: {options.cycles} cycles each, seed {seed}; goal: back within {RESUME_S:g} s of the healing")
    print(HEAD, flush=True)
    own = ["--cycles", str(options.cycles), "--seed", str(seed), "--explain", str(options.explain)]
    module = "load_tests.campaigns.partitions"
    parts = [options.kinds] if options.together else options.kinds.split(",")
    return run_parts(module, parts, own, parallel=options.parallel, show=show)


if __name__ == "__main__":
    raise SystemExit(main())
