"""Twins in worlds of chance: people edit, links break, everybody is killed, and all comes to what was desired.

Each world has four robots and so many edits, made at once in bursts, with cut, delayed and repeated frames, agents and
gateways killed, systems started again, full disks, nodes that jam the link and nodes that a robot refuses among them.
Gateway, store and agents' parts are the real ones (tests/support/robots/twin_testbed.py). A world fails where an edit
is lost or comes twice, a robot keeps what nobody confirmed or goes back behind it, or does not end as it is to be.
"""

from __future__ import annotations

import argparse
import random
import tempfile
import time
from collections import Counter
from pathlib import Path

from metaros.clock import system_rng
from tests.support.processes.fast_loop import HurriedLoop
from tests.support.robots.twin_edits import Edits

__all__ = ["main"]


async def live(folder: Path, seed: int, least: int) -> Counter[str]:
    """One world from its beginning to its end; what went wrong in it on purpose."""
    rng = random.Random(seed)
    edits = Edits(folder, rng)
    await edits.world.begin()
    try:
        while edits.model.edits < least:
            await edits.burst(rng.randint(10, 60), rng.randint(0, 8))
            edits.world.check()
            if rng.random() < 0.1:
                await edits.world.restart_gateway()
                edits.world.faults["gateway"] = edits.world.faults.get("gateway", 0) + 1
        await edits.converge()
        edits.world.check()
        return Counter({"edits": edits.model.edits, **edits.world.faults})
    finally:
        await edits.world.end()


def main(argv: list[str] | None = None) -> int:
    """Run the campaign; exit code 1 when a world did not come to what was desired."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=100)
    parser.add_argument("--edits", type=int, default=1000, help="of each world, at the least")
    parser.add_argument("--seed", type=int, default=None)
    options = parser.parse_args(argv)
    seed = options.seed if options.seed is not None else system_rng().randrange(2**31)
    print(f"twin: {options.worlds} worlds of {options.edits} edits, seed {seed}", flush=True)
    total: Counter[str] = Counter()
    failed = 0
    for number in range(options.worlds):
        began, loop = time.monotonic(), HurriedLoop()
        try:
            with tempfile.TemporaryDirectory() as folder:
                found = loop.run_until_complete(live(Path(folder), seed + number, options.edits))
            total += found
            reported = ", ".join(f"{count} {kind}" for kind, count in sorted(found.items()))
            print(f"seed {seed + number}: {reported}; {time.monotonic() - began:.1f} s", flush=True)
        except (AssertionError, TimeoutError, ExceptionGroup) as error:
            failed += 1
            print(f"seed {seed + number}: FAILED: {error!r}", flush=True)
        finally:
            loop.close()
    reported = ", ".join(f"{count} {kind}" for kind, count in sorted(total.items()))
    print(f"{'FAIL' if failed else 'PASS'}: {failed} of {options.worlds} worlds failed; {reported}", flush=True)
    return int(bool(failed))


if __name__ == "__main__":
    raise SystemExit(main())
