"""`make bench`: every benchmark, or the ones named. Each prints medians of interleaved rounds against its peers."""

from __future__ import annotations

import importlib
import sys

BENCHMARKS = {
    "cdr": "CDR encode and decode against rosbags",
    "executor": "shares of the fair executor and a critical node's timer beside them",
    "ingest": "metric rows and samples through a real gateway",
    "pubsub": "typed publish and receive against raw eclipse-zenoh",
    "service": "service round trips and action goals against raw eclipse-zenoh queries",
    "timer": "how late timers are called, per executor",
}


def main(names: list[str]) -> int:
    """Run the named benchmarks, all without names; exit code 2 on an unknown one."""
    unknown = [name for name in names if name not in BENCHMARKS]
    if unknown:
        print(f"unknown benchmark {', '.join(unknown)}; there are: {', '.join(BENCHMARKS)}", file=sys.stderr)
        return 2
    for name in names or BENCHMARKS:
        print(f"\n{name}: {BENCHMARKS[name]}\n", flush=True)
        importlib.import_module(f"load_tests.bench_{name}").main()
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
