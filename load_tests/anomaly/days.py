"""Days of healthy robots at 1 Hz: what is told although nothing is wrong, by detector.

    python -m load_tests.anomaly days [--robots 24] [--hours 30] [--seed 77]

All begin their day at half past seven. The first hours, in which everything still learns, are not counted. Findings of
one robot and cause within ten minutes are one alert. `offline` is printed and is no false alert: now and then a robot
is started anew, and really is away for most of a minute.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Sequence

import numpy as np

from gateway.alerting.anomaly.evaluator import Evaluator
from gateway.domain.finding import Finding
from load_tests.anomaly.feed import Feed
from load_tests.anomaly.robots import Robots

__all__ = ["main", "run"]

LEARN_S = 6.2 * 3600.0
COOL_DOWN_S = 600.0
GOAL = 0.5  # false alerts a robot-day


def run(*, robots: int, hours: float, seed: int, verbose: bool = True) -> list[tuple[float, Finding]]:
    """What opened after the learning: seconds since the start, and the finding."""
    bodies = Robots(robots, rate_hz=1, rng=np.random.default_rng([seed, 4]), hour=7.5)
    feed = Feed(Evaluator(), robots, rng=np.random.default_rng([seed, 5]))
    found: list[tuple[float, Finding]] = []
    reported = time.monotonic()
    for second in range(int(hours * 3600.0)):
        edges = feed.second(bodies.second(), float(second))
        found += [(float(second), edge.finding) for edge in edges if edge.change == "opened"]
        if verbose and time.monotonic() - reported > 5.0:
            reported = time.monotonic()
            print(f"\r{second / 3600.0:5.1f} h of {robots} robots, {len(found)} findings  ", end="", file=sys.stderr)
    if verbose:
        print(f"\r{feed.rows / 1e6:.0f} million rows{' ' * 40}", file=sys.stderr)
    return found


def main(argv: Sequence[str] = ()) -> int:
    """Print findings and false alerts a robot-day, by detector; 1 when there are too many."""
    parser = argparse.ArgumentParser(prog="python -m load_tests.anomaly days")
    parser.add_argument("--robots", type=int, default=24)
    parser.add_argument("--hours", type=float, default=30.2, help="the first six are for learning")
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--show", action="store_true", help="print every finding")
    chosen = parser.parse_args(argv)
    began = time.process_time()
    found = run(robots=chosen.robots, hours=chosen.hours, seed=chosen.seed)
    counted = [(at_s, finding) for at_s, finding in found if at_s >= LEARN_S]
    robot_days = chosen.robots * (chosen.hours - LEARN_S / 3600.0) / 24.0
    if chosen.show:
        for at_s, finding in found:
            print(f"{at_s / 3600.0:6.2f} h {finding.robot} {finding.kind:10} {finding.series:36} {finding.reason}")
    print(f"{robot_days:.1f} robot-days of healthy robots at 1 Hz, {time.process_time() - began:.0f} s of CPU")
    for kind, count in Counter(finding.kind for _, finding in counted).most_common():
        words = "  (they were away)" if kind == "offline" else ""
        print(f"  {kind:12} {count:4} {count / robot_days:7.2f} a robot-day{words}")
    false = [(at_s, finding) for at_s, finding in counted if finding.kind != "offline"]
    alerts = len({(finding.robot, finding.cause, int(at_s // COOL_DOWN_S)) for at_s, finding in false})
    print(f"false: {alerts} alerts, {alerts / robot_days:.2f} a robot-day, of {len(false)} findings")
    return int(alerts > GOAL * robot_days)
