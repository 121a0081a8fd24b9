"""The benchmark's tables: medians of rounds, and what to doubt about them."""

from __future__ import annotations

import itertools

from load_tests.fanout.measure import Figures, median

__all__ = ["Table", "print_table", "ratio"]

FOREIGN, BUSY_CLIENT = 0.15, 0.9
Table = dict[str, list[Figures]]  # the rounds of each server


def print_table(title: str, table: Table, rate: float) -> None:
    """A row for each server; of one with a tick the name tells it: "gateway, 5 ms, ..."."""
    print(f"\n{title}\n")
    print("| server | m | cores | generator | net | µs a delivery | p50 ms | p99 ms | delivered | client | |")
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for name, runs in table.items():
        cores = sorted(run.cores for run in runs)
        words = name.split()
        tick_ms = next((float(word) for word, unit in itertools.pairwise(words) if unit[:2] == "ms"), 0.0)
        m = f"{max(1.0, rate * tick_ms / 1000):g}"
        generator = f"{median(runs, 'generator_cores'):.3f}" if runs[0].generator_cores else "elsewhere"
        print(
            f"| {name} | {m} | {median(runs, 'cores'):.3f} ({cores[0]:.3f}–{cores[-1]:.3f}) "
            f"| {generator} | {median(runs, 'net_cores'):.3f} | {median(runs, 'us_a_delivery'):.2f} "
            f"| {median(runs, 'p50_ms'):.2f} | {median(runs, 'p99_ms'):.2f} "
            f"| {median(runs, 'delivered') * 100:.1f} % | {median(runs, 'client_cores'):.2f} | {_doubts(runs)} |",
            flush=True,
        )


def ratio(table: Table, peer: str, ours: str, name: str) -> float:
    """How many times more of a figure the peer has."""
    return median(table[peer], name) / max(1e-9, median(table[ours], name))


def _doubts(runs: list[Figures]) -> str:
    doubts = []
    if median(runs, "least") < 0.999:
        doubts.append(f"one viewer got {median(runs, 'least') * 100:.1f} %")
    if median(runs, "client_cores") > BUSY_CLIENT:
        doubts.append("the client was the limit")
    if (foreign := median(runs, "foreign_cores")) > FOREIGN:
        doubts.append(f"others took {foreign:.2f} cores")
    return ", ".join(doubts)
