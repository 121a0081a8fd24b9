"""What it costs to send one topic to many WebSocket viewers, beside PyPI's foxglove-sdk; and what a dead viewer costs.

    python -m load_tests fanout [--quick] [--rounds 5] [--seconds 2] [--sizes 64,1024,65536] [--viewers 1,10,100,500]
    python -m load_tests fanout --json       JSON of what a robot's link brings, beside rosbridge's figures
    python -m load_tests fanout --stall      one viewer of a hundred that never reads

The same client process reads from servers in processes of their own, one after the other, round by round; figures are
medians. Offered load, viewers and messages are the same for all. What the SDK's server publishes is made in its own
process, and so it is in ours but for --json, where a robot brings it: `generator` is what a server takes to publish to
nobody, `net` is without that. The SDK does not set TCP_NODELAY, so its packets wait for the client's delayed
acknowledgements: a second row has the client acknowledge at once (TCP_QUICKACK), which is the fair one at 1 ms. We set
TCP_NODELAY. `m` is messages per tick and viewer. `bare writes` is what this machine asks for one write a tick and
viewer, with no server around it. Rows in which messages were lost, or the client or the rest of the
machine was the limit, say so.
"""

from __future__ import annotations

import argparse
import functools
import os
from contextlib import ExitStack

from load_tests.fanout.client import FoxgloveViewer, StreamViewer
from load_tests.fanout.from_robot import ROSBRIDGE_US, from_robot
from load_tests.fanout.load import Load
from load_tests.fanout.measure import Server
from load_tests.fanout.stall import stall
from load_tests.fanout.table import Table, print_table, ratio
from load_tests.figures import note

__all__ = ["main"]

SIZES, VIEWERS = (64, 1024, 65536), (1, 10, 100, 500)
MOST_A_S = {64: 200_000, 1024: 100_000, 65536: 15_000}  # deliveries of all viewers together
MOST_RATE = {64: 2000, 1024: 1000, 65536: 100}
PEER, PEER_QUICK, OURS_1, OURS_5 = "foxglove-sdk", "foxglove-sdk, quickack", "gateway, 1 ms", "gateway, 5 ms"
BARE_1, BARE_5 = "bare writes, 1 ms", "bare writes, 5 ms"
GOALS = "goals: foxglove-sdk ÷ gateway ≥ 2 at 1 ms and ≥ 5 at 5 ms for 64 B, ≥ 1.5 for 64 KiB, 100 viewers"
TICKS_MS = (5, 20)  # for --json: the default, and that of dashboards


def rate_of(size: int, viewers: int) -> int:
    """Messages a second that a row offers."""
    return min(MOST_RATE[size], MOST_A_S[size] // viewers)


def _servers(stack: ExitStack, options: argparse.Namespace) -> dict[str, Server]:
    pin = [] if options.no_pin else ["--core", "0"]
    started = {}
    for name in (PEER, OURS_1, OURS_5, BARE_1, BARE_5):
        module = "sdk" if name == PEER else "bare" if name in (BARE_1, BARE_5) else "servers"
        tick = [] if name == PEER else ["--tick-ms", name.split()[-2]]
        started[name] = Server(module, *tick, *pin)
        stack.callback(started[name].stop)
    return started


def _compare(options: argparse.Namespace) -> None:
    with ExitStack() as stack:
        servers = _servers(stack, options)
        for size in options.sizes:
            for viewers in options.viewers:
                rate = rate_of(size, viewers)
                load, table = Load(options.seconds, rate, size), Table()
                for _ in range(options.rounds):
                    alone = {name: server.alone(load) for name, server in servers.items()}
                    for name in (PEER, PEER_QUICK, OURS_1, OURS_5, BARE_1, BARE_5):
                        own = PEER if name == PEER_QUICK else name
                        kind = functools.partial(FoxgloveViewer if own == PEER else StreamViewer, size=size)
                        quick = name == PEER_QUICK
                        figures = servers[own].run(load, viewers, kind, quickack=quick, alone_cores=alone[own])
                        table.setdefault(name, []).append(figures)
                print_table(f"{size} B, {rate}/s to {viewers}", table, rate)
                _print_ratios(table)
                _note(f"{size} B to {viewers}", table)
    print(f"\n{GOALS}")


def _print_ratios(table: Table) -> None:
    for ours in (OURS_1, OURS_5):
        for peer in (PEER, PEER_QUICK):
            whole, net = (ratio(table, peer, ours, name) for name in ("us_a_delivery", "net_cores"))
            print(f"CPU a delivery, {peer} ÷ {ours}: {whole:.2f}; net {net:.2f}")
    for ours, bare in ((OURS_1, BARE_1), (OURS_5, BARE_5)):
        least = [ratio(table, peer, bare, "net_cores") for peer in (PEER, PEER_QUICK)]
        print(f"CPU, {ours} ÷ {bare}: net {ratio(table, ours, bare, 'net_cores'):.2f}", end="; ")
        print(f"foxglove-sdk ÷ {bare}, the most that can be had here: {least[0]:.2f}, quickack {least[1]:.2f}")


def _note(row: str, table: Table) -> None:
    for ours, tick in ((OURS_1, "1 ms"), (OURS_5, "5 ms")):
        # At 1 ms the client that acknowledges at once is the fair one: our latency is the SDK's then.
        peer = PEER_QUICK if tick == "1 ms" else PEER
        pairs = zip(table[peer], table[ours], strict=True)
        each = [sdk.us_a_delivery / max(1e-9, own.us_a_delivery) for sdk, own in pairs]
        note(f"{row}, {tick}: CPU of foxglove-sdk ÷ ours", each)


def _numbers(text: str) -> list[int]:
    return [int(word) for word in text.split(",")]


def _options(argv: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rounds", type=int, help="5; with --stall 10")
    parser.add_argument("--seconds", type=float, help="of each run: 2; with --stall 8")
    parser.add_argument("--sizes", type=_numbers, default=SIZES, help="bytes of a message")
    parser.add_argument("--viewers", type=_numbers, default=VIEWERS)
    parser.add_argument("--quick", action="store_true", help="one short round of few rows, to see that it runs")
    parser.add_argument("--json", action="store_true", help="JSON of a robot's link, beside rosbridge's figures")
    parser.add_argument("--stall", action="store_true", help="one viewer that never reads")
    parser.add_argument("--no-pin", action="store_true", help="let servers and client run on any CPU")
    options = parser.parse_args(argv)
    if options.quick:
        options.rounds, options.viewers = 1, [100]
        options.seconds = options.seconds or (4.0 if options.stall else 1.0)
    options.rounds = options.rounds or (10 if options.stall else 5)
    options.seconds = options.seconds or (8.0 if options.stall else 2.0)
    if (os.cpu_count() or 1) < 2 or not hasattr(os, "sched_setaffinity"):
        options.no_pin = True
    return options


def main(argv: list[str]) -> int:
    """Measure and print."""
    options = _options(argv)
    pin = not options.no_pin
    if pin:
        os.sched_setaffinity(0, {1})
    if options.stall:
        return stall(rounds=options.rounds, seconds=options.seconds, viewers=9 if options.quick else 99, pin=pin)
    if options.json:
        ticks_ms = TICKS_MS[:1] if options.quick else TICKS_MS
        rows = list(ROSBRIDGE_US)[: 1 if options.quick else None]
        from_robot(rounds=options.rounds, seconds=options.seconds, ticks_ms=ticks_ms, rows=rows, pin=pin)
        return 0
    _compare(options)
    return 0


if __name__ == "__main__":
    import sys

    raise SystemExit(main(sys.argv[1:]))
