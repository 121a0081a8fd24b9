"""Disks that somebody else fills, on the robot and on the gateway; events are never lost, and the link stays up.

A small tmpfs is the disk. In each cycle another program takes every byte that is free, for a while, and gives all back;
then the time is taken until the robot accepts again (its disk) or the gateway acknowledges again (the gateway's). In
every fourth cycle and in the last one the robot or the gateway is killed meanwhile, and must start where nothing can be
written. With `--together` both sides have such a disk, and their cycles take turns.
Needs Linux with user namespaces; runs as any user.

    python -m load_tests.campaigns disks [--cycles 20] [--together] [--seed N]
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import os
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

from load_tests.campaigns.namespaces import result, run_parts
from metaros.clock import system_rng
from tests.support.processes.netns import run, why_not
from tests.support.robots.load_robot_stack import LoadStack

__all__ = ["Filler", "main"]

MIB = 1024 * 1024
DISK_BYTES = {"robot": 24 * MIB, "gateway": 256 * MIB}
GOAL_S, LIMIT_S, FELT_S = 1.0, 10.0, 30.0


class DiskStack(LoadStack):
    """A gateway or robot that starts on a full disk may end; a supervisor starts it again."""

    may_end = ("gateway", "robot")


class Filler:
    """The other program: takes all that is free, again and again."""

    def __init__(self, disk: Path) -> None:
        self._path = disk / "somebody_elses"

    def take(self) -> None:
        """Everything that is free now."""
        descriptor = os.open(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        block = bytes(MIB)
        try:
            while block:
                try:
                    os.write(descriptor, block)
                except OSError:
                    block = block[: len(block) // 2]
        finally:
            os.close(descriptor)

    def hold(self, seconds: float, felt: Callable[[], bool] = lambda: True) -> None:
        """Keep it full for a while and until it was felt, whatever others free."""
        least, most = time.monotonic() + seconds, time.monotonic() + FELT_S
        while time.monotonic() < least or not felt():
            if time.monotonic() > most:
                raise TimeoutError(f"nobody felt a full disk for {FELT_S:g} s")
            self.take()
            time.sleep(0.01)

    def free(self) -> None:
        """Give it all back."""
        self._path.unlink(missing_ok=True)


def cycle(stack: LoadStack, who: str, filler: Filler, rng: Random, *, kill: bool) -> tuple[float, bool]:
    """Fill, hold, free; seconds until it works again, and whether the link stayed up."""
    sessions = stack.counters["sessions"]
    said = "retry_later" if who == "gateway" else "refused"
    before = stack.counters[said]
    filler.hold(rng.uniform(0.3, 0.8), lambda: stack.counters[said] > before)
    if kill:
        stack.kill(who)
        filler.hold(0.1)
        stack.start(who)
        filler.hold(rng.uniform(0.3, 0.8))
    stayed = kill or stack.counters["sessions"] == sessions
    freed_ns = time.monotonic_ns()
    filler.free()
    if who == "gateway" and not kill:
        back_s = stack.wait_ack(freed_ns)
        return back_s, stayed and stack.counters["sessions"] == sessions
    what = "accept_ns" if who == "robot" else "ack_ns"
    while stack.counters[what] <= freed_ns:
        if not stack.alive(who):  # it could not start: a supervisor tries again
            stack.kill(who)
            stack.start(who)
        time.sleep(0.005)
        if time.monotonic_ns() - freed_ns > 30e9:
            raise TimeoutError(f"the {who} does not come back\n{stack.tail(who)}")
    return (stack.counters[what] - freed_ns) / 1e9, stayed


def run_inside(sides: list[str], cycles: int, seed: int) -> int:
    """The disks of these sides in turn, in the namespaces of this process."""
    rng, times, restarts, cycled = Random(seed), list[float](), list[float](), 0
    with tempfile.TemporaryDirectory(prefix="campaign-disks-") as name, contextlib.ExitStack() as mounted:
        folder = Path(name)
        disks = {who: folder / ("state" if who == "robot" else "data") for who in sides}
        run("ip link set lo up")
        for who, disk in disks.items():
            disk.mkdir()
            run(f"mount -t tmpfs -o size={DISK_BYTES[who]} disk {disk}")
            mounted.callback(run, f"umount {disk}", check=False)
        with DiskStack(folder) as stack:
            stack.start("gateway")
            stack.start("robot")
            stack.wait_online()
            for number, who in itertools.product(range(cycles), sides):
                kill = number % 4 == 3 or number == cycles - 1
                time.sleep(rng.uniform(0.1, 0.3))
                back_s, stayed = cycle(stack, who, Filler(disks[who]), rng, kill=kill)
                (restarts if kill else times).append(back_s)
                cycled += not stayed
                stack.wait_online()
            later = sum(stack.page(life)["retry_later"] for life in range(stack.lives))
            refused = sum(stack.page(life)["refused"] for life in range(stack.lives))
            verdict = stack.check()
            event = json.loads((folder / "final.json").read_text())["streams"]["event"]
            gaps = stack.stored().gaps
    lost_events = sum(b - a + 1 for (_, stream), spans in gaps.items() if stream == event for a, b, _ in spans)
    verdict.blame("lost", lost_events, f"{lost_events} events were given up")
    verdict.blame("wrong", cycled, f"the link was cycled {cycled} times by a full disk")
    facts = {"times": times, "restarts": restarts, "retry_later": later, "refused": refused}
    return result(verdict, **facts, reasons=dict(verdict.reasons))


HEAD = (
    f"{'disk of':>10} {'cycles':>7} {'accepted':>9} {'rows':>9} {'declared':>9} {'lost':>5} {'dup':>5} {'wrong':>6} "
    f"{'later':>6} {'refused':>8} {'median':>7} {'max s':>6} {'killed: median':>15} {'max s':>6}"
)


def show(part: str, facts: dict[str, Any]) -> bool:
    """A line of the table; whether it came back each time, and both sides said what they felt."""
    sides = part.split(",")
    who = part if len(sides) == 1 else "both"
    times, restarts = facts["times"] or [0.0], facts["restarts"] or [0.0]
    print(
        f"{who:>10} {len(facts['times']) + len(facts['restarts']):>7} {facts['accepted']:>9,} {facts['rows']:>9,} "
        f"{facts['declared']:>9,} {facts['lost']:>5} {facts['duplicate']:>5} {facts['wrong']:>6} "
        f"{facts['retry_later']:>6} {facts['refused']:>8} {statistics.median(times):>7.2f} {max(times):>6.2f} "
        f"{statistics.median(restarts):>15.2f} {max(restarts):>6.2f}"
    )
    print(f"{'':>10} declared: {', '.join(f'{why} {count:,}' for why, count in facts['reasons'].items()) or 'nothing'}")
    felt = all(facts["retry_later" if side == "gateway" else "refused"] for side in sides)
    return felt and max(times) <= LIMIT_S


def main(argv: list[str] | None = None) -> int:
    """Run the campaign; exit code 1 when a sample was lost, stored twice, or wrong, or something stayed down."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cycles", type=int, default=20)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--together", action="store_true", help="both disks in turn, on one robot and gateway")
    parser.add_argument("--inside", help=argparse.SUPPRESS)
    options = parser.parse_args(argv)
    seed = options.seed if options.seed is not None else system_rng().randrange(2**32)
    if options.inside:
        return run_inside(options.inside.split(","), options.cycles, seed)
    if reason := why_not():
        print(f"disks cannot be filled here: {reason}")
        return 0
    print(f"disks: {options.cycles} cycles each, seed {seed}; goal: works again within {GOAL_S:g} s")
    print(HEAD, flush=True)
    own = ["--cycles", str(options.cycles), "--seed", str(seed)]
    parts = [",".join(DISK_BYTES)] if options.together else list(DISK_BYTES)
    return run_parts("load_tests.campaigns.disks", parts, own, parallel=2, show=show)


if __name__ == "__main__":
    raise SystemExit(main())
