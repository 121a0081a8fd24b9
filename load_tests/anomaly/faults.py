"""Faults injected into simulated robots: how many are found, how soon, and what is told of healthy ones.

    python -m load_tests.anomaly faults [--each 20] [--robots 45] [--hours 30] [--seed 77] [--quick]

The same evaluator as the gateway's, with everything on as it comes. First every robot works for some hours in which the
detectors learn; then each has its faults, one after the other, at 10 Hz metrics. A fault is found when something opens
on what it touches while it lasts; its delay is until the call that told it. After that the days part (`days.py`).
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Sequence
from typing import TextIO

import numpy as np

from gateway.alerting.anomaly.evaluator import Evaluator
from load_tests.anomaly import days
from load_tests.anomaly.feed import Feed, robot_name
from load_tests.anomaly.injected import KINDS, Fault, inject, plan
from load_tests.anomaly.robots import SERIES, Robots, Seconds

__all__ = ["DEFAULT_SEED", "main", "run"]

DEFAULT_SEED = 77
LEARN_S = 6.2 * 3600.0
GRACE_S = 10.0


class _Deviations:
    """How much each series of each robot varies while it learns."""

    def __init__(self, robots: int) -> None:
        self._count, self._sum, self._square = 0, np.zeros((robots, len(SERIES))), np.zeros((robots, len(SERIES)))

    def add(self, seconds: Seconds) -> None:
        values = np.concatenate((seconds.fast[-1], seconds.slow), axis=1)
        self._count += 1
        self._sum += values
        self._square += values * values

    def values(self) -> np.ndarray:
        mean = self._sum / max(self._count, 1)
        return np.sqrt(np.maximum(self._square / max(self._count, 1) - mean * mean, 0.0))


def run(
    *,
    each: int,
    robots: int,
    seed: int,
    learn_s: float = LEARN_S,
    until_s: float = math.inf,
    verbose: bool = True,
    log: TextIO | None = None,
) -> list[Fault]:
    """All faults, with when and by what they were found `until_s`; each is written to `log` when it is over."""
    rng = np.random.default_rng([seed, 1])
    bodies = Robots(robots, rate_hz=10, rng=np.random.default_rng([seed, 2]), hour=7.5)
    feed = Feed(Evaluator(), robots, rng=np.random.default_rng([seed, 3]))
    faults = plan(robots, each, learn_s=learn_s, rng=rng)
    waiting = {number: [fault for fault in faults if fault.robot == number] for number in range(robots)}
    deviations, second, reported = _Deviations(robots), 0, time.monotonic()
    running: dict[int, Fault] = {}
    while second < until_s and (
        any(waiting.values()) or any(fault.found_s < 0.0 for fault in running.values())  # who may still be found
    ):
        seconds = bodies.second()
        if second < learn_s:
            deviations.add(seconds)
        _begin(waiting, running, bodies, second)
        for fault in running.values():
            inject(fault, bodies, seconds, deviations.values(), now_s=float(second), rng=rng)
        for edge in feed.second(seconds, float(second)):
            if edge.change == "opened":
                _found(running, edge.finding.robot, edge.finding.series, edge.finding.kind, second + 1.0)
        for number, fault in list(running.items()):
            if second - fault.begin_s >= fault.kind.lasts_s + GRACE_S:
                del running[number]
                if log is not None:
                    print(_line(fault), file=log, flush=True)
        second += 1
        if verbose and time.monotonic() - reported > 5.0:
            reported = time.monotonic()
            left = sum(map(len, waiting.values()))
            print(f"\r{second / 3600.0:5.1f} h of {robots} robots, {left} faults to come  ", end="", file=sys.stderr)
    if log is not None:
        print("".join(f"{_line(fault)}\n" for fault in running.values()), end="", file=log, flush=True)
    if verbose:
        print(f"\r{feed.rows / 1e6:.0f} million rows{' ' * 40}", file=sys.stderr)
    return faults


def _line(fault: Fault) -> str:
    """One fault, for those who look at what was missed."""
    names = ", ".join(SERIES[place].name for place in fault.places)
    found = f"{fault.found_s - fault.begin_s:6.0f} s {fault.found_by:12}" if fault.found_s >= 0.0 else "missed"
    return f"{found:21} {fault.kind.name:14} {robot_name(fault.robot)} {fault.topic} {names} {fault.size:.2f}"


def _begin(waiting: dict[int, list[Fault]], running: dict[int, Fault], bodies: Robots, second: int) -> None:
    """The next fault of each robot that is due; none at the charger, where none would matter."""
    for number, faults in waiting.items():
        if not faults or number in running or second < faults[0].due_s or bodies.motions.docked[number]:
            continue
        if faults[0].kind.moving and not bodies.motions.driving[number]:
            continue
        fault = faults.pop(0)
        fault.begin_s = float(second)
        running[number] = fault
        for later in faults[:1]:
            later.due_s = max(later.due_s, second + fault.kind.lasts_s + 900.0)


def _found(running: dict[int, Fault], robot: str, series: str, kind: str, now_s: float) -> None:
    for fault in running.values():
        mine = robot_name(fault.robot) == robot and series in fault.names()
        if mine and fault.found_s < 0.0 and now_s - fault.begin_s <= fault.kind.lasts_s:
            fault.found_s, fault.found_by = now_s, kind


def report(faults: Sequence[Fault]) -> tuple[float, float, float]:
    """Print the table; overall recall, the least of any kind, and the median delay of abrupt ones."""
    print(f"{'fault':16} {'found':>9} {'recall':>7} {'median delay':>13} {'worst':>8}   found by")
    recalls, abrupt = [], []
    for kind in KINDS:
        mine = [fault for fault in faults if fault.kind == kind]
        delays = [fault.found_s - fault.begin_s for fault in mine if fault.found_s >= 0.0]
        abrupt += delays if kind.abrupt else []
        recalls.append(len(delays) / max(len(mine), 1))
        by = Counter(fault.found_by for fault in mine if fault.found_by).most_common(4)
        middle, worst = (np.median(delays), max(delays)) if delays else (np.nan, np.nan)
        words = ", ".join(f"{name} {count}" for name, count in by)
        recall = f"{len(delays):4}/{len(mine):<4} {recalls[-1]:7.2f}"
        print(f"{kind.name:16} {recall} {middle:11.1f} s {worst:6.0f} s   {words}")
    total = sum(fault.found_s >= 0.0 for fault in faults) / max(len(faults), 1)
    delay = float(np.median(abrupt)) if abrupt else float("nan")
    print(f"recall {total:.3f}, least {min(recalls):.2f}; median delay of abrupt faults {delay:.1f} s")
    return total, min(recalls), delay


def main(argv: Sequence[str] = ()) -> int:
    """Both parts; 1 when a goal is missed."""
    parser = argparse.ArgumentParser(prog="python -m load_tests.anomaly faults")
    parser.add_argument("--each", type=int, default=20, help="faults of each kind")
    parser.add_argument("--robots", type=int, default=45, help="robots that have them")
    parser.add_argument("--hours", type=float, default=30.2, help="of each of 24 healthy robots, learning included")
    parser.add_argument("--seed", type=int, default=DEFAULT_SEED)
    parser.add_argument("--quick", action="store_true", help="three faults of each kind, and no days part")
    parser.add_argument("--missed", action="store_true", help="name the faults that were not found")
    chosen = parser.parse_args(argv)
    began = time.process_time()
    faults = run(each=3 if chosen.quick else chosen.each, robots=chosen.robots, seed=chosen.seed)
    print(f"seed {chosen.seed}: {len(faults)} faults, {time.process_time() - began:.0f} s of CPU")
    total, least, delay = report(faults)
    if chosen.missed:
        print("\n".join(_line(fault) for fault in faults if fault.found_s < 0.0))
    good = total >= 0.95 and least >= 0.85 and delay <= 5.0
    if chosen.quick:
        return 0
    return int(not good) | days.main(["--hours", str(chosen.hours), "--seed", str(chosen.seed)])
