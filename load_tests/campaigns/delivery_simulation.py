"""Simulated worlds of the delivery contract by their seeds: agent, link, gateway and store in memory.

python -m load_tests.campaigns.delivery_simulation --seeds 7 8 9         just these; a failure is shown in full
python -m load_tests.campaigns.delivery_simulation --kind clone --seeds 7  with clones (or restore, wipe, rollback, rot)

`make campaign ARGS=simulator` runs tens of thousands of them.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Collection, Iterable

from tests.support.simulation.link_sim import KINDS, LinkSimulation, run_simulation

__all__ = ["Failure", "main", "run"]

Failure = tuple[int, str]


def run(seeds: Iterable[int], *, kinds: Collection[str] | None = None) -> list[Failure]:
    """Run worlds; the seeds that failed, and how."""
    failures: list[Failure] = []
    for seed in seeds:
        try:
            run_simulation(seed, kinds=kinds)
        except Exception as error:  # whatever it is, the seed is what matters
            failures.append((seed, f"{type(error).__name__}: {error}"))
    return failures


def main(argv: list[str] | None = None) -> int:
    """Run the worlds; the first that breaks the contract ends it with its traceback."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, nargs="+", required=True)
    parser.add_argument("--kind", action="append", choices=sorted(KINDS), help="of mishap; default: as the seed says")
    options = parser.parse_args(argv)
    for seed in options.seeds:
        print(
            f"seed {seed}: {', '.join(sorted(LinkSimulation(seed, kinds=options.kind).kinds)) or 'plain'}", flush=True
        )
        run_simulation(seed, kinds=options.kind)
    return 0


if __name__ == "__main__":
    sys.exit(main())
