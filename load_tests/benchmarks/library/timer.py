"""How late timers are called, per executor, on a node with nothing else to do.

    python -m load_tests timer [--seconds 3] [--rounds 3]

Lateness is from the time a call was due to the first line of the callback; drift would add up and show. Rounds are
interleaved, the figures are medians over the rounds.
"""

from __future__ import annotations

import argparse
import asyncio
import os
import statistics
import sys
import threading
import time
from collections.abc import Callable, Sequence

import metaros
from load_tests.figures import note
from metaros.node import Node

__all__ = ["main", "run"]

RATES_HZ = (100, 1000)
_WARM_UP_S = 0.2


def _spin(executor: metaros.SingleThreadedExecutor, node: Node) -> Callable[[], None]:
    """Spin in the background; returns how to end it."""
    executor.add_node(node)
    thread = threading.Thread(target=executor.spin)
    thread.start()

    def end() -> None:
        executor.shutdown()
        thread.join()

    return end


def _spin_asyncio(node: Node) -> Callable[[], None]:
    executor = metaros.AsyncioExecutor(node)
    thread = threading.Thread(target=lambda: asyncio.run(executor.run()))
    thread.start()

    def end() -> None:
        executor.shutdown()
        thread.join()

    return end


def _spin_critical(node: Node) -> Callable[[], None]:
    node.critical = True
    return _spin(metaros.FairExecutor(), node)


EXECUTORS: dict[str, Callable[[Node], Callable[[], None]]] = {
    "single-threaded": lambda node: _spin(metaros.SingleThreadedExecutor(), node),
    "multi-threaded": lambda node: _spin(metaros.MultiThreadedExecutor(), node),
    "asyncio": _spin_asyncio,
    "fair": lambda node: _spin(metaros.FairExecutor(), node),
    "fair, critical": _spin_critical,
}


def run(*, seconds: float, rounds: int) -> dict[tuple[str, int], list[tuple[float, float, int]]]:
    """p50 and p99 in seconds, and missed periods, of every (executor, rate), one triple a round."""
    found: dict[tuple[str, int], list[tuple[float, float, int]]] = {
        (name, rate_hz): [] for rate_hz in RATES_HZ for name in EXECUTORS
    }
    for _ in range(rounds):
        for name, rate_hz in found:
            found[name, rate_hz].append(_measure(EXECUTORS[name], 1 / rate_hz, seconds))
    return found


def _measure(spin: Callable[[Node], Callable[[], None]], period_s: float, seconds: float) -> tuple[float, float, int]:
    with metaros.Context(domain_id=0, connect=[]) as context:
        node = metaros.Node("bench_timer", context=context, enable_rosout=False)
        late_s: list[float] = []
        timer = node.create_timer(period_s, lambda: late_s.append(time.monotonic() - (timer.due_s - period_s)))
        end = spin(node)
        time.sleep(_WARM_UP_S)
        late_s.clear()
        missed = timer.statistics.missed
        time.sleep(seconds)
        end()
        late_s.sort()
        return late_s[len(late_s) // 2], late_s[int(len(late_s) * 0.99)], timer.statistics.missed - missed


def main(argv: Sequence[str] = ()) -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=3.0, help="measured time a round and row")
    parser.add_argument("--rounds", type=int, default=3, help="interleaved rounds")
    options = parser.parse_args(list(argv))
    print(f"{'executor':<20}{'rate':>8}{'p50 us':>10}{'p99 us':>10}{'missed':>8}")
    for (name, rate_hz), rows in run(seconds=options.seconds, rounds=options.rounds).items():
        if (name, rate_hz) == ("single-threaded", 100):
            note("p99 late at 100 Hz, single-threaded", [row[1] * 1e6 for row in rows])
        p50_us, p99_us = (statistics.median(row[index] for row in rows) * 1e6 for index in (0, 1))
        print(f"{name:<20}{rate_hz:>5} Hz{p50_us:>10.0f}{p99_us:>10.0f}{sum(row[2] for row in rows):>8}")
    print(f"medians of {options.rounds} rounds on {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
