"""Tens of thousands of seeded worlds of the link's two halves, in memory: ten times what the test suite runs.

python -m load_tests.campaigns simulator [--seeds 50000] [--first N]
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import time

from metaros.clock import system_rng
from tests.support.simulation.link_sim import run_simulation

__all__ = ["main"]

SHOWN = 10


def run_seed(seed: int) -> tuple[int, str]:
    """A world; what was wrong with it, or nothing."""
    try:
        run_simulation(seed)
    except Exception as error:  # whatever it is, the seed is what counts
        return seed, f"{type(error).__name__}: {error}"
    return seed, ""


def main(argv: list[str] | None = None) -> int:
    """Run the worlds; exit code 1 when a promise was broken in one."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=50_000)
    parser.add_argument("--first", type=int, default=None, help="the first seed; default: any")
    options = parser.parse_args(argv)
    first = options.first if options.first is not None else system_rng().randrange(2**32)
    print(f"simulator: seeds {first} to {first + options.seeds - 1}", flush=True)
    began, bad, done = time.monotonic(), [], 0
    with multiprocessing.Pool(os.cpu_count()) as pool:
        for seed, problem in pool.imap_unordered(run_seed, range(first, first + options.seeds), chunksize=50):
            done += 1
            if problem:
                bad.append(seed)
                if len(bad) <= SHOWN:
                    print(f"  seed {seed}: {problem[:300]}", flush=True)
            if done % 1000 == 0 and sys.stdout.isatty():
                print(f"\r  {done:,} of {options.seeds:,}", end="", flush=True)
    print(f"\r  {done:,} worlds, {len(bad)} broken, {time.monotonic() - began:.0f} s")
    if bad:
        print(f"  FAIL; repeat: make campaign ARGS='simulator --seeds 1 --first {bad[0]}'")
    else:
        print("  PASS")
    return int(bool(bad))


if __name__ == "__main__":
    raise SystemExit(main())
