"""Simulated worlds of the delivery contract, as many as you like: agent, link, gateway and store in memory, by seed.

python -m load_tests.campaign_sim                     50,000 worlds over all processors
python -m load_tests.campaign_sim --seeds 7 8 9       just these; a failure is shown in full
python -m load_tests.campaign_sim --kind clone        every world with clones (restore, wipe, rollback, rot)
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import time
from collections.abc import Collection, Iterable

from tests.support.link_sim import KINDS, World, run_world

__all__ = ["Failure", "main", "run"]

Failure = tuple[int, str]
BLOCK = 100


def run(seeds: Iterable[int], *, kinds: Collection[str] | None = None) -> list[Failure]:
    """Run worlds in this process; the seeds that failed, and how."""
    failures: list[Failure] = []
    for seed in seeds:
        try:
            run_world(seed, kinds=kinds)
        except Exception as error:  # whatever it is, the seed is what matters
            failures.append((seed, f"{type(error).__name__}: {error}"))
    return failures


def _block(job: tuple[range, Collection[str] | None]) -> list[Failure]:
    seeds, kinds = job
    return run(seeds, kinds=kinds)


def run_many(first: int, count: int, *, kinds: Collection[str] | None = None) -> list[Failure]:
    """Run worlds on every processor; a line of progress now and then."""
    jobs = [(range(at, min(at + BLOCK, first + count)), kinds) for at in range(first, first + count, BLOCK)]
    failures: list[Failure] = []
    began = said = time.monotonic()
    with multiprocessing.get_context("spawn").Pool() as pool:
        for done, some in enumerate(pool.imap_unordered(_block, jobs), 1):
            failures += some
            for seed, error in some:
                print(f"seed {seed}: {error}", flush=True)
            if time.monotonic() - said > 10 or done == len(jobs):
                said = time.monotonic()
                worlds = min(done * BLOCK, count)
                print(f"{worlds:7,} worlds, {len(failures)} failed, {said - began:4.0f} s", flush=True)
    return failures


def main(argv: list[str] | None = None) -> int:
    """Run the worlds; exit code 1 when one broke the contract."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--count", type=int, default=50_000)
    parser.add_argument("--seeds", type=int, nargs="+", help="only these, here, with a traceback")
    parser.add_argument("--kind", action="append", choices=sorted(KINDS), help="in every world")
    options = parser.parse_args(argv)
    if options.seeds:
        for seed in options.seeds:
            print(f"seed {seed}: {', '.join(sorted(World(seed, kinds=options.kind).kinds)) or 'plain'}", flush=True)
            run_world(seed, kinds=options.kind)
        return 0
    return int(bool(run_many(options.first, options.count, kinds=options.kind)))


if __name__ == "__main__":
    sys.exit(main())
