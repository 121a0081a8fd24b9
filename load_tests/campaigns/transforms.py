"""Random trees of frames over time: what `tf2_py` says of them, and what 4x4 matrices say, error for error.

python -m load_tests.campaigns transforms [--trees 10000] [--first N]
"""

from __future__ import annotations

import argparse
import logging
import multiprocessing
import os
import time

from metaros.clock import system_rng
from metaros.ros2 import tf2_py
from tests.support.ros2.random_trees import check_tree

__all__ = ["main"]

SHOWN = 10


def run_tree(seed: int) -> tuple[int, int, str]:
    """A tree; how many poses were compared, and what differed."""
    logging.getLogger("metaros.ros2.tf2").setLevel(logging.ERROR)
    try:
        return seed, check_tree(seed, tf2_py.BufferCore, tf2_py), ""
    except Exception as error:  # whatever it is, the seed is what counts
        return seed, 0, f"{type(error).__name__}: {error}"


def main(argv: list[str] | None = None) -> int:
    """Run the trees; exit code 1 when one answer differed."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--trees", type=int, default=10_000)
    parser.add_argument("--first", type=int, default=None, help="the first seed; default: any")
    options = parser.parse_args(argv)
    first = options.first if options.first is not None else system_rng().randrange(2**32)
    print(f"transforms: seeds {first} to {first + options.trees - 1}", flush=True)
    began, bad, poses = time.monotonic(), [], 0
    with multiprocessing.Pool(os.cpu_count()) as pool:
        for seed, compared, problem in pool.imap_unordered(run_tree, range(first, first + options.trees), chunksize=50):
            poses += compared
            if problem:
                bad.append(seed)
                if len(bad) <= SHOWN:
                    print(f"  seed {seed}: {problem[:400]}", flush=True)
    print(f"  {options.trees:,} trees, {poses:,} poses, {len(bad)} trees differ, {time.monotonic() - began:.0f} s")
    if bad:
        print(f"  FAIL; repeat: make campaign ARGS='transforms --trees 1 --first {bad[0]}'")
    else:
        print("  PASS")
    return int(bool(bad))


if __name__ == "__main__":
    raise SystemExit(main())
