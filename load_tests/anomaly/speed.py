"""What judging costs: `python -m load_tests.anomaly speed [--series N] [--rounds N]`.

Ten thousand series with a sample a second each, as 40 metrics of 250 robots: the bank of detectors alone, then all that
judges a robot (checks, lasting changes, novelties, presence, vectors, cohorts), and river's HalfSpaceTrees beside them
in an environment of its own. The rounds are interleaved, times are of the processor, figures are medians.
"""

from __future__ import annotations

import argparse
import gc
import statistics
import subprocess
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import psutil

from gateway.alerting.anomaly.detectors.bank import PAGE_ROWS, Bank
from gateway.alerting.anomaly.evaluator import Evaluator
from load_tests.anomaly.table import table
from load_tests.figures import note
from load_tests.peers.venvs import HomeFailed, python_of

__all__ = ["main"]

PER_ROBOT = 40
WARM_STEPS, WARM_STEP_S = 260, 700.0  # two days and more: every novelty of the bank is at work
START_S = 1_767_225_600.0
TREE_SAMPLES = 3000


@dataclass(slots=True)
class Figures:
    """What one subject's rounds measured."""

    each_us: list[float] = field(default_factory=list)
    longest_ms: float = 0.0
    kib: float = 0.0

    def row(self, name: str) -> tuple[str, ...]:
        """For the table."""
        if not self.each_us:
            return name, "–", "–", "–", "–"
        each = statistics.median(self.each_us)
        longest = f"{self.longest_ms:.1f}" if self.longest_ms else "–"
        return name, f"{each:.2f}", f"{each:.1f} %", f"{self.kib:.1f}" if self.kib else "–", longest


class Signals:
    """The same kind of values for everything: a slow daily wave, noise, and a step now and then."""

    def __init__(self, series: int) -> None:
        self._rng = np.random.default_rng(10)
        self._base = self._rng.normal(size=series) * 50.0
        self._spread = self._rng.uniform(0.1, 5.0, size=series)

    def at(self, stamp_s: float) -> np.ndarray:
        """A value for each series."""
        count = len(self._base)
        self._base += np.where(self._rng.random(count) < 1e-4, self._rng.normal(size=count) * 20.0, 0.0)
        daily = np.sin(stamp_s / 86_400.0 * 2.0 * np.pi)
        return self._base + self._spread * (3.0 * daily + self._rng.normal(size=count))


class Banked:
    """The detectors alone, a page of slots a call."""

    def __init__(self, series: int) -> None:
        self.figures, before = Figures(), resident_bytes()
        self._bank, self._signals, self._now_s = Bank(), Signals(series), START_S
        self._slots = np.array([self._bank.add() for _ in range(series)])
        for _ in range(WARM_STEPS):
            self._now_s += WARM_STEP_S
            self._tick()
        self.figures.kib = max(self._bank.size_bytes, resident_bytes() - before) / series / 1024

    def _tick(self) -> float:
        values, stamps = self._signals.at(self._now_s), np.full(len(self._slots), self._now_s)
        taken_s = longest_s = 0.0
        for start in range(0, len(self._slots), PAGE_ROWS):
            part = slice(start, start + PAGE_ROWS)
            started = time.thread_time()
            self._bank.update(self._slots[part], stamps[part], values[part])
            took_s = time.thread_time() - started
            taken_s, longest_s = taken_s + took_s, max(longest_s, took_s)
        self.figures.longest_ms = max(self.figures.longest_ms, longest_s * 1000)
        return taken_s

    def round(self, ticks: int) -> None:
        """So many seconds of all series."""
        taken_s = 0.0
        for _ in range(ticks):
            self._now_s += 1.0
            taken_s += self._tick()
        self.figures.each_us.append(taken_s / ticks / len(self._slots) * 1e6)


class Judged:
    """Everything that judges robots; its ticks belong to a worker thread."""

    def __init__(self, series: int, *, warm_s: int) -> None:
        self.figures, before = Figures(), resident_bytes()
        self._evaluator, self._signals, self._now_s = Evaluator(), Signals(series), START_S
        self._slots = np.array([self._slot(number) for number in range(series)])
        for _ in range(warm_s):
            self._tick()
        self.figures.kib = (resident_bytes() - before) / series / 1024

    def _slot(self, number: int) -> int:
        robot, metric = divmod(number, PER_ROBOT)
        if not metric:
            self._evaluator.robot(f"robot_{robot}", "carrier")
        topic = f"/robot_{robot}/topic_{metric // 4}"
        return self._evaluator.slot(f"robot_{robot}", f"topic_{metric // 4}.field_{metric % 4}", topic)

    def _tick(self) -> float:
        self._now_s += 1.0
        values, stamps = self._signals.at(self._now_s), np.full(len(self._slots), self._now_s)
        started = time.thread_time()
        self._evaluator.samples(self._slots, stamps, values)
        self._evaluator.tick(self._now_s)
        return time.thread_time() - started

    def round(self, ticks: int) -> None:
        """So many seconds of all series."""
        taken_s = [self._tick() for _ in range(ticks)]
        self.figures.each_us.append(sum(taken_s) / ticks / len(self._slots) * 1e6)


class Trees:
    """River's trees, in a process of their own; none where they cannot be installed."""

    def __init__(self) -> None:
        self.figures = Figures()
        script = Path(__file__).with_name("river_trees.py")
        self._process = subprocess.Popen(
            [python_of("river"), str(script)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def round(self, samples: int) -> None:
        """So many samples of one series."""
        assert self._process.stdin
        assert self._process.stdout
        self._process.stdin.write(f"{samples}\n")
        self._process.stdin.flush()
        self.figures.each_us.append(float(self._process.stdout.readline()))

    def close(self) -> None:
        """End the process."""
        self._process.communicate(timeout=60)


def main(argv: Sequence[str]) -> int:
    """Measure and print; river is left out where it cannot be installed."""
    parser = argparse.ArgumentParser(prog="python -m load_tests.anomaly speed", description=__doc__)
    parser.add_argument("--series", type=int, default=10_000)
    parser.add_argument("--rounds", type=int, default=7)
    parser.add_argument("--ticks", type=int, default=20, help="seconds of all series a round")
    parser.add_argument("--warm-s", type=int, default=300, help="seconds that everything runs before the rounds")
    options = parser.parse_args(argv)
    trees = _trees()
    bank, evaluator = Banked(options.series), Judged(options.series, warm_s=options.warm_s)
    for _ in range(options.rounds):
        bank.round(options.ticks)
        evaluator.round(options.ticks)
        if trees:
            trees.round(TREE_SAMPLES)
    if trees:
        trees.close()
    _show(options, bank.figures, evaluator.figures, trees.figures if trees else Figures())
    return 0


def _show(options: argparse.Namespace, bank: Figures, evaluator: Figures, trees: Figures) -> None:
    print(f"{options.series:,} series, a sample a second each; medians of {options.rounds} interleaved rounds\n")
    note("a sample, detectors", bank.each_us, peer=trees.each_us)
    note("a sample, everything", evaluator.each_us, peer=trees.each_us)
    note("a series, everything", [evaluator.kib])
    names = ("", "µs a sample", "of a core at 10,000 Hz", "KiB a series", "longest call, ms")
    rows = [bank.row("detectors (Bank)"), evaluator.row("everything (Judge)"), trees.row("river HalfSpaceTrees")]
    print(table(names, rows))
    print(f"\nThe longest call is one page of {PAGE_ROWS} series. Memory is what the process grew by.")
    if trees.each_us:
        each = statistics.median(trees.each_us)
        ratios = (each / statistics.median(one.each_us) for one in (bank, evaluator))
        print("River's trees take {:.1f} times as long as the detectors, {:.1f} times as everything.".format(*ratios))


def _trees() -> Trees | None:
    try:
        return Trees()
    except HomeFailed as error:
        print(f"river: {error}")
        return None


def resident_bytes() -> int:
    """Of this process, after its garbage went."""
    gc.collect()
    return int(psutil.Process().memory_info().rss)
