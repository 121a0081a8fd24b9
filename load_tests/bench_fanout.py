"""What it costs to send one topic to many WebSocket viewers, beside PyPI's foxglove-sdk; and what a dead viewer costs.

    python -m load_tests fanout [--quick] [--rounds 5] [--seconds 2] [--sizes 64,1024,65536] [--viewers 1,10,100,500]
    python -m load_tests fanout --json       the stream's JSON and rosbridge, beside rosbridge's own figures
    python -m load_tests fanout --stall      one viewer of a hundred that never reads

The same client process reads from servers in processes of their own, one after the other, round by round; figures are
medians. Offered load, viewers and messages are the same for all; what a server publishes is made in its own process.
The SDK does not set TCP_NODELAY, so its packets wait for the client's delayed acknowledgements: a second row has the
client acknowledge at once (TCP_QUICKACK), which is the fair one at 1 ms. We set TCP_NODELAY. `m` is messages per tick
and viewer. `net` is without what the same server takes to publish to nobody. Rows in which messages were lost, or the
client or the rest of the machine was the limit, say so.
"""

from __future__ import annotations

import argparse
import functools
import os
from collections.abc import Callable
from contextlib import ExitStack

from load_tests.fanout.client import FoxgloveViewer, JsonViewer, RosbridgeViewer, StreamViewer, Viewer
from load_tests.fanout.measure import Figures, Server, median
from load_tests.fanout.servers import Load
from load_tests.fanout.stall import stall

__all__ = ["main"]

SIZES, VIEWERS = (64, 1024, 65536), (1, 10, 100, 500)
MOST_A_S = {64: 200_000, 1024: 100_000, 65536: 15_000}  # deliveries of all viewers together
MOST_RATE = {64: 2000, 1024: 1000, 65536: 100}
FOREIGN, BUSY_CLIENT = 0.15, 0.9
PEER, PEER_QUICK, OURS_1, OURS_5 = "foxglove-sdk", "foxglove-sdk, quickack", "gateway, 1 ms", "gateway, 5 ms"
GOALS = "goals: foxglove-sdk ÷ gateway ≥ 1.5 at 1 ms and ≥ 5 at 5 ms for 64 B, ≥ 1.5 for 64 KiB, 100 viewers"
# Of rosbridge (ROS 1, 55a6bdb), us of CPU a delivery, by 64 B messages a second and viewers; see benchmarks.md.
ROSBRIDGE_US = {(1000, 10): 49.0, (100, 100): 55.0}

Table = dict[str, list[Figures]]


def rate_of(size: int, viewers: int) -> int:
    """Messages a second that a row offers."""
    return min(MOST_RATE[size], MOST_A_S[size] // viewers)


def _servers(stack: ExitStack, options: argparse.Namespace, *names: str) -> dict[str, Server]:
    pin = [] if options.no_pin else ["--core", "0"]
    started = {}
    for name in names:
        own = ["foxglove"] if name == PEER else ["gateway", "--tick-ms", name.split()[1]]
        started[name] = Server(*own, *pin)
        stack.callback(started[name].stop)
    return started


def _compare(options: argparse.Namespace) -> None:
    with ExitStack() as stack:
        servers = _servers(stack, options, PEER, OURS_1, OURS_5)
        for size in options.sizes:
            for viewers in options.viewers:
                rate = rate_of(size, viewers)
                load, table = Load(options.seconds, rate, size), Table()
                for _ in range(options.rounds):
                    alone = {name: server.alone(load) for name, server in servers.items()}
                    for name in (PEER, PEER_QUICK, OURS_1, OURS_5):
                        own = PEER if name == PEER_QUICK else name
                        kind = functools.partial(FoxgloveViewer if own == PEER else StreamViewer, size=size)
                        quick = name == PEER_QUICK
                        figures = servers[own].run(load, viewers, kind, quickack=quick, alone_cores=alone[own])
                        table.setdefault(name, []).append(figures)
                _print(f"{size} B, {rate}/s to {viewers}", table, rate)
                _print_ratios(table)
    print(f"\n{GOALS}")


def _print(title: str, table: Table, rate: float) -> None:
    print(f"\n{title}\n\n| server | m | cores | net | µs a delivery | p50 ms | p99 ms | delivered | client | |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name, runs in table.items():
        cores = sorted(run.cores for run in runs)
        words = name.split()
        m = f"{max(1.0, rate * float(words[1]) / 1000):g}" if words[0] == "gateway," else "1"
        print(
            f"| {name} | {m} | {median(runs, 'cores'):.3f} ({cores[0]:.3f}–{cores[-1]:.3f}) "
            f"| {median(runs, 'net_cores'):.3f} | {median(runs, 'us_a_delivery'):.2f} "
            f"| {median(runs, 'p50_ms'):.2f} | {median(runs, 'p99_ms'):.2f} "
            f"| {median(runs, 'delivered') * 100:.1f} % | {median(runs, 'client_cores'):.2f} | {_doubts(runs)} |",
            flush=True,
        )


def _doubts(runs: list[Figures]) -> str:
    doubts = []
    if median(runs, "least") < 0.999:
        doubts.append(f"one viewer got {median(runs, 'least') * 100:.1f} %")
    if median(runs, "client_cores") > BUSY_CLIENT:
        doubts.append("the client was the limit")
    if (foreign := median(runs, "foreign_cores")) > FOREIGN:
        doubts.append(f"others took {foreign:.2f} cores")
    return ", ".join(doubts)


def _print_ratios(table: Table) -> None:
    def ratio(peer: str, ours: str, name: str) -> str:
        return f"{median(table[peer], name) / max(1e-9, median(table[ours], name)):.2f}"

    for ours in (OURS_1, OURS_5):
        for peer in (PEER, PEER_QUICK):
            net = ratio(peer, ours, "net_cores")
            print(f"CPU a delivery, {peer} ÷ {ours}: {ratio(peer, ours, 'us_a_delivery')}; net {net}")


def _json(options: argparse.Namespace) -> None:
    kinds: dict[str, Callable[[int], Viewer]] = {
        "stream, JSON": functools.partial(JsonViewer, size=64),
        "rosbridge door": functools.partial(RosbridgeViewer, size=64),
    }
    with ExitStack() as stack:
        servers = _servers(stack, options, OURS_1, OURS_5)
        for (rate, viewers), theirs in ROSBRIDGE_US.items():
            table = Table()
            for _ in range(options.rounds):
                for tick, server in servers.items():
                    load = Load(options.seconds, rate, 64, text=True)
                    alone_cores = server.alone(load)
                    for name, kind in kinds.items():
                        figures = server.run(load, viewers, kind, alone_cores=alone_cores)
                        table.setdefault(f"{tick}, {name}", []).append(figures)
            _print(f"JSON, 64 B, {rate}/s to {viewers}; rosbridge of ROS 1: {theirs:g} µs a delivery", table, rate)
            for name, runs in table.items():
                net_us = median(runs, "net_cores") * 1e6 / (rate * viewers)
                per_core = theirs / median(runs, "us_a_delivery")
                print(f"deliveries a core, {name} ÷ rosbridge: {per_core:.1f}; net {theirs / net_us:.1f}")


def _numbers(text: str) -> list[int]:
    return [int(word) for word in text.split(",")]


def main(argv: list[str]) -> int:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--seconds", type=float, default=2.0, help="of each run")
    parser.add_argument("--sizes", type=_numbers, default=SIZES, help="bytes of a message")
    parser.add_argument("--viewers", type=_numbers, default=VIEWERS)
    parser.add_argument("--quick", action="store_true", help="one round of three rows")
    parser.add_argument("--json", action="store_true", help="JSON, beside rosbridge's figures")
    parser.add_argument("--stall", action="store_true", help="one viewer that never reads")
    parser.add_argument("--no-pin", action="store_true", help="let servers and client run on any CPU")
    options = parser.parse_args(argv)
    if options.quick:
        options.rounds, options.viewers = 1, [100]
    if (os.cpu_count() or 1) < 2 or not hasattr(os, "sched_setaffinity"):
        options.no_pin = True
    if not options.no_pin:
        os.sched_setaffinity(0, {1})
    if options.stall:
        return stall(rounds=options.rounds, pin=not options.no_pin)
    (_json if options.json else _compare)(options)
    return 0


if __name__ == "__main__":
    import sys

    raise SystemExit(main(sys.argv[1:]))
