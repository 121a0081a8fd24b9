"""`make bench-anomaly`: what the detectors find, how often they are wrong, and what they cost.

The first word says what to measure; a folder instead means `nab` on that folder.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Sequence

BENCHMARKS = {
    "nab": ("nab_bench", "NAB v1.1's score, on the development series or on any folder of such files"),
    "faults": ("faults", "faults injected into simulated robots: recall, delay, false alerts a robot-day"),
    "days": ("days", "simulated robots that only drive: false alerts a robot-day"),
    "speed": ("speed", "microseconds and KiB a series, beside river's HalfSpaceTrees"),
}


def main(argv: Sequence[str]) -> int:
    """Run one benchmark with the options behind its name; exit code 2 for what there is not."""
    name, options = (argv[0], argv[1:]) if argv and argv[0] in BENCHMARKS else ("nab", argv)
    if not argv or argv[0] in ("-h", "--help"):
        for known, (_, what) in BENCHMARKS.items():
            print(f"python -m load_tests.anomaly {known:7} {what}")
        return 0 if argv else 2
    module = importlib.import_module(f"load_tests.anomaly.{BENCHMARKS[name][0]}")
    return int(module.main(options))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
