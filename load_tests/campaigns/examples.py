"""The property tests with examples that nobody has seen: each round draws from another seed.

    make campaign ARGS="examples --rounds 5 --seed 7"

In `make test` and CI hypothesis draws the same examples each time. What a round finds is shrunk and printed; it becomes
an ordinary test, so that it is never found twice.
"""

from __future__ import annotations

import argparse
import subprocess
import sys

from metaros.clock import system_rng

__all__ = ["main"]


def main(argv: list[str]) -> int:
    """Run the rounds; 1 when one of them failed."""
    parser = argparse.ArgumentParser(prog="campaign examples", description=__doc__)
    parser.add_argument("--rounds", type=int, default=10, help="how many seeds")
    parser.add_argument("--seed", type=int, help="of the first round; the next ones count on")
    options = parser.parse_args(argv)
    first = system_rng().randrange(2**31) if options.seed is None else options.seed
    failed = [seed for seed in range(first, first + options.rounds) if not _passes(seed)]
    print(
        f"  {'FAIL' if failed else 'PASS'}: {len(failed)} of {options.rounds} rounds failed {failed or ''}", flush=True
    )
    return int(bool(failed))


def _passes(seed: int) -> bool:
    print(f"  seed {seed}", flush=True)
    drawn = ["--hypothesis-profile=default", f"--hypothesis-seed={seed}", "-m", "hypothesis"]
    command = [sys.executable, "-m", "pytest", "-q", "-n", "2", "-p", "no:cacheprovider", *drawn]
    return subprocess.run(command, check=False).returncode == 0
